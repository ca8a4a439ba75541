#include <algorithm>
#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/ops/ops.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "train/photo_offsets.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

const Dataset& faces(std::int64_t side = 64) {
    static const Dataset small = synthetic_dataset(64), large = synthetic_dataset(128);
    return side == 64 ? small : large;
}

TrainConfig with_source(const std::string& source) {
    TrainConfig config = tiny_train_config();
    config.model.code_source = source;
    config.data.mirror = false;
    config.loss.code_norm_weight = 0.0;
    return config;
}

TrainConfig with_decoder(const std::string& render) {
    TrainConfig config = tiny_two_stage_config();
    config.model.decoder.resolution = 64;
    config.stage1.samples_per_ray = config.stage2.samples_per_ray = 2;
    config.stage2.resolutions = {64};
    config.stage2.images = {2};
    config.stage2.fade_images = {0};
    config.stage2.batch = {2};
    config.stage2.micro_batch = {2};
    config.stage2.r1_gamma = {0.1};
    config.model.decoder.conditioning = "concatenation";
    config.model.decoder.render = render;
    config.model.decoder.mapping_layers = 0;
    config.loss.mask_weight = 0.1;
    config.loss.mask_start_epoch = 0;
    return config;
}

/// Trains for all steps, or until `stop` and then, resumed, to the end. Gives the text of the last
/// checkpoint's two files.
std::vector<std::string> trained(const TrainConfig& config, const fs::path& folder,
                                 std::int64_t stop = 0) {
    if (stop > 0) {
        TrainConfig first = config;
        first.stage1.steps = stop;
        Trainer trainer(first, faces(config.model.decoder.resolution), nullptr, 5);
        CHECK(trainer.run(RunFolder(folder, false), {}).finished);
    }
    const RunFolder run(folder, stop > 0);
    Trainer trainer(config, faces(config.model.decoder.resolution), nullptr, 5);
    if (stop > 0) trainer.resume(run.checkpoint(stop));
    const TrainingOutcome outcome = trainer.run(run, {});
    CHECK(outcome.finished);
    const fs::path last = run.checkpoint(outcome.steps);
    return {read_file(last / "model.safetensors"), read_file(last / "state.safetensors")};
}

FaceBatch batch_of(std::int64_t first, std::int64_t count) {
    std::vector<Face> chosen;
    for (std::int64_t i = first; i < first + count; ++i) chosen.push_back(faces().load(i));
    return make_batch(chosen);
}

Model make_model(const ModelConfig& config) {
    Rng rng(1);
    return {config, rng};
}

}  // namespace

TEST_CASE(
    "a model whose codes come from the data has no encoder and starts from the data's code, plus "
    "what was learnt",
    "[codes]") {
    const Model model = make_model(with_source("morphable_offset").model);
    CHECK_FALSE(model.has_encoder());
    CHECK(model.parameters().element_count("encoder.") == 0);
    CHECK(is_one_line(error_message<ValueError>([&] { static_cast<void>(model.encoder()); })));
    const FaceBatch batch = batch_of(1, 2);
    const Codes given = face_codes(model, batch);
    for (std::size_t group = 0; group < 4; ++group)
        CHECK(identical(given.groups[group].value(), batch.codes[group]));

    PhotoOffsets offsets(faces().ids(), {.codes = true});
    CHECK(offsets.parameters().element_count() == 4 * code_size);
    const Parameter expression = offsets.parameters().all()[1];
    CHECK(expression.name() == "codes.offset.expr");
    expression.set_value(Rng(3).normal(expression.variable().shape(), 0.0, 1.0));
    const Codes moved = face_codes(model, batch, &offsets);
    const Tensor rows = slice(expression.variable(), 0, 1, 3).value();
    CHECK(
        identical(moved.expression().value(), (Variable(batch.codes[1]) + Variable(rows)).value()));
    CHECK(identical(moved.identity().value(), batch.codes[0]));
    const Variable gradient = grad(sum(square(moved.expression())), expression.variable());
    CHECK(sum(abs(slice(gradient, 0, 1, 3))).value().item() > 0.0);
    CHECK(sum(abs(slice(gradient, 0, 0, 1))).value().item() == 0.0);
    CHECK(sum(abs(slice(gradient, 0, 3, 4))).value().item() == 0.0);
    FaceBatch unknown = batch;
    unknown.ids.back() = "nobody";
    CHECK_THROWS_WITH(offsets.codes(unknown), Catch::Contains("face nobody"));
}

TEST_CASE("a photo without a code is refused in one line by what needs it", "[codes]") {
    const Model model = make_model(with_source("morphable").model);
    Face face = faces().load(2);
    face.has_code = false;
    const FaceBatch batch = make_batch(std::vector{faces().load(0), face});
    const std::string message =
        error_message<ValueError>([&] { static_cast<void>(face_codes(model, batch)); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains("face " + face.id + " has no code"));

    const ScratchFolder folder;
    fs::copy(synthetic_folder(), folder / "faces", fs::copy_options::recursive);
    fs::remove(folder / "faces/faces.jsonl");
    const TrainConfig config = with_source("morphable");
    const Dataset without(folder / "faces", 64, config.data, Split::all);
    const std::string refusal =
        error_message<ConfigError>([&] { Trainer(config, without, nullptr, 1); });
    CHECK(is_one_line(refusal));
    CHECK_THAT(refusal, Catch::Contains("codes.source = morphable") && Catch::Contains("4 of 4"));
}

TEST_CASE("each source of codes trains, and a run that stops and resumes gives the same bits",
          "[codes]") {
    for (const std::string source : {"morphable", "morphable_offset", "encoder_offset"}) {
        INFO(source);
        const ScratchFolder folder;
        TrainConfig config = with_source(source);
        config.data.mirror = source == "encoder_offset";
        const std::vector<std::string> whole = trained(config, folder / "whole");
        CHECK(trained(config, folder / "parts", 2) == whole);
        CHECK((whole[1].find("codes.offset.tex") != std::string::npos) == (source != "morphable"));
    }
}

TEST_CASE("offsets that are learnt move away from zero and go on into the second stage as they are",
          "[codes]") {
    TrainConfig config = tiny_two_stage_config();
    config.model.code_source = "morphable_offset";
    config.data.mirror = false;
    const ScratchFolder folder;
    static_cast<void>(trained(config, folder / "run"));
    const auto offset_at = [&](const char* step) {
        return read_tensor_file(folder / "run/checkpoints" / step / "state.safetensors")
            .tensors.at("codes.offset.id");
    };
    CHECK(sum(abs(Variable(offset_at("000002")))).value().item() > 0.0);
    CHECK(identical(offset_at("000002"), offset_at("000006")));
}

TEST_CASE("both decoders with concatenated codes train through both stages and resume bit for bit",
          "[codes]") {
    for (const std::string render : {"blocks", "none"}) {
        INFO(render);
        const ScratchFolder folder;
        const TrainConfig config = with_decoder(render);
        const std::vector<std::string> whole = trained(config, folder / "whole");
        CHECK(trained(config, folder / "parts", 1) == whole);
        for (const nlohmann::json& line : statistics(folder / "whole")) {
            CHECK(std::isfinite(line["loss"].get<double>()));
            CHECK(line["opacity"].get<double>() > 0.0);
        }
    }
}
