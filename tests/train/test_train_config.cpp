#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <set>
#include <string>

#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "support/error_message.h"
#include "train/train_config.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

const fs::path configurations = fs::path(STYMO_SOURCE_DIR) / "configs";

std::vector<fs::path> configuration_files() {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(configurations))
        // The folder of the head-mask network has a configuration of its own kind.
        if (entry.path().extension() == ".json" && entry.path().filename() != "training.json")
            files.push_back(entry.path());
    std::ranges::sort(files);
    return files;
}

std::string refusal(const std::vector<std::string>& overrides) {
    const ScratchFolder folder;
    write_file(folder / "config.json", "{}");
    std::string message = error_message<ConfigError>(
        [&] { static_cast<void>(load_train_config(folder / "config.json", overrides)); });
    CHECK(is_one_line(message));
    return message;
}

}  // namespace

TEST_CASE(
    "every configuration that comes with the project is accepted and describes a model that can be "
    "made",
    "[train_config]") {
    REQUIRE_FALSE(configuration_files().empty());
    std::set<std::string> made;
    for (const fs::path& file : configuration_files()) {
        INFO(file.string());
        const TrainConfig config = load_train_config(file, {});
        CHECK(config.stage1.steps > 0);
        ModelConfig model = config.model;
        model.encoder.backbone_weights.clear();
        // The large ones take seconds to draw.
        if (!made.insert(model.encoder.backbone).second) model.encoder.backbone = "small_conv";
        Rng rng(1);
        CHECK(Model(model, rng).parameters().element_count() > 0);
    }
}

TEST_CASE("the configuration of the paper has the paper's numbers", "[train_config]") {
    const TrainConfig config = load_train_config(configurations / "paper-512.json", {});
    CHECK(config.model.decoder.resolution == 512);
    CHECK(config.model.decoder.rays.rays_per_side == 32);
    CHECK(config.model.decoder.feature_channels == 256);
    CHECK(config.model.reconstruction.resolution_weights ==
          std::vector<double>{0.01, 0.1, 0.5, 1.0});
    CHECK(config.model.reconstruction.photometric_weight == 1.0);
    CHECK(config.model.reconstruction.fit_samples_per_ray == 64);
    CHECK(config.model.reconstruction.fit_regularizer == 1.0);
    CHECK(config.data.test == 1000);
    CHECK(config.data.validation == 1000);
    CHECK(config.loss.code_weights == std::vector<double>{0.001, 0.1, 0.001, 0.01});
    CHECK(config.loss.mask_weight == 0.01);
    CHECK(config.loss.opacity_weight == 0.0);
    CHECK(config.loss.depth_variance_weight == 0.0);
    CHECK(config.optimizer.learning_rate == 1e-4);
    CHECK(config.optimizer.schedule == "epoch");
    CHECK(config.optimizer.decay == 0.98);
    CHECK(config.optimizer.backbone_frozen_epochs == 1);
    CHECK(config.stage1.batch == 32);
    CHECK(config.stage1.samples_per_ray == 32);
    CHECK(config.model.encoder.backbone == "iresnet50");
    CHECK(config.model.reconstruction.perceptual.network == "vgg16");
    CHECK(config.model.reconstruction.perceptual_weight == 0.1);
    CHECK(config.loss.adversarial_weight == 0.1);
    CHECK(config.stage2.resolutions == std::vector<std::int64_t>{64, 128, 256, 512});
    CHECK(config.stage2.batch == std::vector<std::int64_t>{32, 32, 16, 12});
    CHECK(config.stage2.samples_per_ray == 64);
    CHECK(config.stage2.learning_rate == 2e-3);
    CHECK(config.stage2.discriminator_learning_rate == 1e-4);
}

TEST_CASE("values that do not fit each other are refused in one line that names them",
          "[train_config]") {
    CHECK_THAT(refusal({"stage1.batch=8", "stage1.micro_batch=3"}),
               Catch::Contains("config.json") && Catch::Contains("stage1.micro_batch = 3") &&
                   Catch::Contains("stage1.batch = 8"));
    CHECK_THAT(refusal({"stage1.batch=4", "stage1.micro_batch=8"}),
               Catch::Contains("stage1.micro_batch = 8"));
    CHECK_THAT(refusal({"reconstruction.resolution_weights=[1, 1]"}),
               Catch::Contains("reconstruction.resolution_weights has 2") &&
                   Catch::Contains("512 pixels needs 4"));
    CHECK_THAT(refusal({"stage1.resolution=96"}),
               Catch::Contains("stage1.resolution = 96") && Catch::Contains("[64, 128, 256, 512]"));
    CHECK_THAT(refusal({"loss.code_weights=[1, 1, 1]"}),
               Catch::Contains("loss.code_weights has 3"));
    CHECK_THAT(refusal({"decoder.rays_per_side=16", "decoder.block_channels=[256,128,64,32,32]",
                        "reconstruction.resolution_weights=[0.01,0.01,0.1,0.5,1]"}),
               Catch::Contains("decoder.rays_per_side = 16") && Catch::Contains("32"));
}

TEST_CASE(
    "a second stage that does not fit the model or itself is refused in one line that names the "
    "key",
    "[train_config]") {
    CHECK_THAT(
        refusal({"decoder.resolution=128"}),
        Catch::Contains(
            "stage2.resolutions = [64, 128, 256, 512]: a model of 128 pixels needs [64, 128]"));
    CHECK_THAT(refusal({"stage2.resolutions=[128, 256, 512]"}),
               Catch::Contains("stage2.resolutions = [128, 256, 512]"));
    for (const std::string key : {"images", "fade_images", "batch", "micro_batch", "r1_gamma"})
        CHECK_THAT(refusal({"stage2." + key + "=[2, 2]"}),
                   Catch::Contains("stage2." + key + " has 2 numbers, stage2.resolutions 4"));
    CHECK_THAT(refusal({"stage2.micro_batch=[8, 8, 5, 4]"}),
               Catch::Contains("stage2.micro_batch = [8, 8, 5, 4] does not divide"));
    CHECK_THAT(refusal({"stage2.fade_images=[0, 0, 0, 500001]"}),
               Catch::Contains("must not exceed stage2.images"));
    CHECK_THAT(refusal({"stage2.fade_images=[1, 0, 0, 0]"}), Catch::Contains("must begin with 0"));
    CHECK_THAT(refusal({"discriminator.group_size=3"}),
               Catch::Contains("discriminator.group_size = 3 does not divide 8"));
    CHECK_THAT(refusal({"stage2.images=[0, 1, 1, 1]"}), Catch::Contains("stage2.images"));
}

TEST_CASE("an empty list of resolutions is no second stage, whatever the other lists hold",
          "[train_config]") {
    const ScratchFolder folder;
    write_file(folder / "config.json", "{}");
    const TrainConfig config =
        load_train_config(folder / "config.json",
                          {"stage2.resolutions=[]", "decoder.resolution=64", "stage2.batch=[3]"});
    CHECK(config.stage2.resolutions.empty());
    CHECK_NOTHROW(load_train_config(folder / "config.json",
                                    {"loss.adversarial_weight=0", "discriminator.group_size=3"}));
}

TEST_CASE("an unknown key, a wrong type and a value out of range are refused", "[train_config]") {
    CHECK_THAT(refusal({"optimizer.learning_rat=1"}), Catch::Contains("optimizer.learning_rate"));
    CHECK_THAT(refusal({"stage1.steps=many"}), Catch::Contains("stage1.steps"));
    CHECK_THAT(refusal({"stage1.batch=0"}), Catch::Contains("stage1.batch"));
    CHECK_THAT(refusal({"optimizer.schedule=linear"}),
               Catch::Contains("optimizer.schedule") && Catch::Contains("cosine"));
}

TEST_CASE("what is written of a configuration reads back to the same", "[train_config]") {
    const ScratchFolder folder;
    for (const fs::path& file : configuration_files()) {
        const std::string text =
            to_json(load_train_config(file, {"optimizer.learning_rate=0.1234567890123"}));
        write_file(folder / "config.json", text);
        CHECK(to_json(load_train_config(folder / "config.json", {})) == text);
    }
}

TEST_CASE("the table of keys has a line for every key of a written configuration",
          "[train_config]") {
    const std::string table = configuration_table();
    for (const char* key : {"decoder.resolution", "encoder.backbone", "camera.focal",
                            "reconstruction.fit_regularizer", "data.split.test", "loss.mask_weight",
                            "optimizer.schedule", "stage1.micro_batch", "output.keep_last"})
        CHECK_THAT(table, Catch::Contains(key));
}

TEST_CASE("codes of the data do not go with mirrored photos", "[train_config]") {
    CHECK_THAT(refusal({"codes.source=morphable", "data.mirror=true"}),
               Catch::Contains("codes.source = morphable needs data.mirror = false"));
    CHECK_THAT(refusal({"loss.expression_weight=0.1"}),
               Catch::Contains("loss.expression_weight needs encoder.expression_backbone"));
    CHECK_THAT(refusal({"loss.expression_weight=0.1", "encoder.expression_backbone=landmarks",
                        "stage1.micro_batch=1"}),
               Catch::Contains("loss.expression_weight needs stage1.micro_batch >= 2"));
    CHECK_THAT(refusal({"loss.identity_weight=0.1"}),
               Catch::Contains("loss.identity_weight needs loss.identity_network"));
    CHECK_THAT(refusal({"loss.side_identity_weight=0.1"}),
               Catch::Contains("loss.side_identity_weight needs loss.identity_network"));
    CHECK_THAT(refusal({"codes.source=morphable", "data.other_photo=0.5"}),
               Catch::Contains("codes.source = morphable needs data.other_photo = 0"));
    CHECK_THAT(refusal({"codes.source=morphable", "data.turned_photos=0.5"}),
               Catch::Contains("codes.source = morphable needs data.turned_photos = 0"));
    CHECK_THAT(refusal({"optimizer.matrices=muon", "stage1.decoder_frozen=true"}),
               Catch::Contains("choose muon_encoder or adam"));
    CHECK_THAT(refusal({"encoder.identity_from_both=true"}),
               Catch::Contains("encoder.identity_from_both needs encoder.identity_backbone"));
    CHECK_THAT(refusal({"stage1.encoder_frozen=true", "stage1.decoder_frozen=true",
                        "optimizer.matrices=adam"}),
               Catch::Contains("only encoder.corrections learn; give some"));
    CHECK_THAT(refusal({"codes.source=morphable", "data.mirror=false", "encoder.corrections=1"}),
               Catch::Contains("codes.source = morphable needs encoder.corrections = 0"));
    CHECK_THAT(refusal({"encoder.identity_backbone=small_conv"}),
               Catch::Contains("encoder.identity_backbone"));
    CHECK_THAT(refusal({"decoder.conditioning=concatenation", "optimizer.sample_tolerance=0.001"}),
               Catch::Contains("optimizer.sample_tolerance needs"));
    CHECK_THAT(refusal({"codes.source=morphable", "stage1.decoder_frozen=true"}),
               Catch::Contains("codes.source = morphable needs stage1.decoder_frozen = false"));
}
