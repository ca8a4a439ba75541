#include <catch2/catch.hpp>

#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "core/work_counts.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

std::string refusal(const std::filesystem::path& path) {
    std::string message = error_message<FileError>([&] { static_cast<void>(Model::load(path)); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains(path.string()));
    return message;
}

}  // namespace

TEST_CASE("a model that was saved and loaded encodes and renders to the same bits", "[model]") {
    const ScratchFolder folder;
    const Model model = tiny_model(3);
    model.save(folder / "model.safetensors");
    const Model loaded = Model::load(folder / "model.safetensors");
    CHECK(to_json(loaded.config()) == to_json(model.config()));
    CHECK(loaded.parameters().trainable().empty());

    Rng rng(1);
    const Variable image(rng.uniform({1, 64, 64, 3}, -1.0, 1.0));
    const Codes codes = model.encoder()(image);
    const Codes loaded_codes = loaded.encoder()(image);
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        CHECK(identical(codes.groups[group].value(), loaded_codes.groups[group].value()));
        CHECK_FALSE(loaded_codes.groups[group].tracked());
    }
    const ViewOptions options{.samples_per_ray = 4, .mask = true, .depth = true};
    const Camera camera = model_camera(model, 0.3, 0.0, 0.0);
    const View view = render_view(model, codes, 0, camera, options);
    const View loaded_view =
        render_view(loaded, loaded_codes, 0, model_camera(loaded, 0.3, 0.0, 0.0), options);
    CHECK(identical(view.image, loaded_view.image));
    CHECK(identical(view.mask, loaded_view.mask));
    CHECK(identical(view.depth, loaded_view.depth));

    loaded.save(folder / "again.safetensors");
    CHECK(read_file(folder / "again.safetensors") == read_file(folder / "model.safetensors"));
}

TEST_CASE("a model with the longest focal length that data may have is read again", "[model]") {
    const ScratchFolder folder;
    ModelConfig config = tiny_model_config();
    config.camera = with_intrinsics(config.camera, {.focal = 100.0});
    Rng rng(1);
    Model(config, rng).save(folder / "model.safetensors");
    CHECK(Model::load(folder / "model.safetensors").config().camera.distance > 100.0);
}

TEST_CASE("a model keeps the PSNR of its validation photos, if it is a number", "[model]") {
    const ScratchFolder folder;
    Model model = tiny_model(3);
    CHECK_FALSE(model.validation_psnr());
    model.set_validation_psnr(21.25);
    model.save(folder / "model.safetensors");
    const Model loaded = Model::load(folder / "model.safetensors");
    CHECK(loaded.validation_psnr() == 21.25);
    CHECK(loaded.copy(ModelParts::decoder).validation_psnr() == 21.25);
    TensorFile file = read_tensor_file(folder / "model.safetensors");
    for (const char* text : {"", "high", "1e999", "inf", "nan", "21.25 dB"}) {
        file.metadata["validation_psnr"] = text;
        write_tensor_file(folder / "other.safetensors", file);
        CHECK_FALSE(Model::load(folder / "other.safetensors").validation_psnr());
    }
}

TEST_CASE("of a model that only renders no encoder is made, and its frames have the same bits",
          "[model]") {
    const ScratchFolder folder;
    const Model model = tiny_model(3);
    model.save(folder / "model.safetensors");
    const WorkMeter meter;
    const Model decoder = Model::load(folder / "model.safetensors", ModelParts::decoder);
    CHECK(decoder.parameters().element_count("encoder.") == 0);
    CHECK(decoder.parameters().element_count() == model.parameters().element_count("decoder."));
    CHECK(meter.counts().parameters == std::ssize(decoder.parameters().all()));
    const Camera camera = model_camera(model, 0.3, 0.0, 0.0);
    const ViewOptions options{.samples_per_ray = 4};
    CHECK(identical(render_view(decoder, random_codes(1, 2), 0, camera, options).image,
                    render_view(model, random_codes(1, 2), 0, camera, options).image));
    CHECK_FALSE(decoder.has_encoder());
    CHECK_THROWS_AS(decoder.encoder(), ValueError);
    CHECK_THROWS_AS(decoder.save(folder / "part.safetensors"), ValueError);
    CHECK_FALSE(std::filesystem::exists(folder / "part.safetensors"));
}

TEST_CASE("a model loads though the weights its backbone came from are gone", "[model]") {
    const ScratchFolder folder;
    tiny_model(3).save(folder / "model.safetensors");
    TensorFile file = read_tensor_file(folder / "model.safetensors");
    std::string& config = file.metadata["config"];
    const std::string empty = "\"backbone_weights\": \"\"";
    REQUIRE(config.find(empty) != std::string::npos);
    config.replace(config.find(empty), empty.size(),
                   "\"backbone_weights\": \"/nowhere/weights.safetensors\"");
    write_tensor_file(folder / "model.safetensors", file);
    CHECK_NOTHROW(Model::load(folder / "model.safetensors"));
}

TEST_CASE("what is not a model is refused in one line that names the file", "[model]") {
    const ScratchFolder folder;
    CHECK_THAT(refusal(folder / "missing.safetensors"), Catch::Contains("cannot be read"));
    write_file(folder / "text.safetensors", "not a model at all");
    static_cast<void>(refusal(folder / "text.safetensors"));

    tiny_model(3).save(folder / "model.safetensors");
    const TensorFile good = read_tensor_file(folder / "model.safetensors");
    const auto refused = [&](const TensorFile& file) {
        write_tensor_file(folder / "bad.safetensors", file);
        return refusal(folder / "bad.safetensors");
    };
    TensorFile foreign;
    foreign.tensors["weight"] = Tensor::zeros({3});
    CHECK_THAT(refused(foreign), Catch::Contains("not a model of stymo"));
    for (const char* key : {"format", "config"}) {
        TensorFile file = good;
        file.metadata.erase(key);
        CHECK_THAT(refused(file), Catch::Contains("not a model of stymo"));
    }
    TensorFile older = good;
    older.metadata["format"] = "stymo-model-0";
    CHECK_THAT(refused(older), Catch::Contains("stymo-model-1"));
    TensorFile incomplete = good;
    incomplete.tensors.erase("decoder.field.density.weight");
    CHECK_THAT(refused(incomplete), Catch::Contains("has no tensor decoder.field.density.weight"));
    TensorFile other_shape = good;
    other_shape.tensors["decoder.field.density.weight"] = Tensor::zeros({5, 7});
    CHECK_THAT(refused(other_shape), Catch::Contains("(5, 7)"));

    std::filesystem::resize_file(folder / "model.safetensors",
                                 std::filesystem::file_size(folder / "model.safetensors") / 2);
    static_cast<void>(refusal(folder / "model.safetensors"));
}

TEST_CASE("a small file that claims a large network is refused before its memory is taken",
          "[model]") {
    const ScratchFolder folder;
    TensorFile file;
    file.metadata["format"] = "stymo-model-1";
    for (const char* claim :
         {R"({"decoder": {"field_width": 4096, "field_layers": 32}})",
          R"({"decoder": {"field_width": 4096, "field_layers": 32, "feature_channels": 4096,
                          "block_channels": [4096, 4096, 4096, 4096]},
              "codes": {"source": "morphable"}})",
          R"({"encoder": {"backbone": "iresnet50", "head_width": 4096}})"}) {
        file.metadata["config"] = claim;
        write_tensor_file(folder / "claim.safetensors", file);
        CHECK(std::filesystem::file_size(folder / "claim.safetensors") < 1024);
        const WorkMeter meter;
        CHECK_THAT(refusal(folder / "claim.safetensors"), Catch::Contains("has no tensor "));
        CHECK(meter.counts().peak_bytes < std::int64_t{512} << 20);
    }
}

TEST_CASE("a model is written whole or not at all", "[model]") {
    const ScratchFolder folder;
    write_file(folder / "file", "");
    CHECK(is_one_line(error_message<FileError>(
        [&] { tiny_model().save(folder / "file" / "model.safetensors"); })));
    CHECK(folder.file_count() == 1);
}
