#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/io/scratch_folder.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "nn/models/view.h"
#include "nn/models/widened_model.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// Deep enough for the encoding to enter twice, and with two blocks.
Model deep_model(std::uint64_t seed) {
    ModelConfig config = tiny_model_config();
    config.decoder.resolution = 32;
    config.decoder.field_layers = 4;
    config.decoder.block_channels = {6, 4};
    config.reconstruction.resolution_weights = {1.0, 1.0};
    Rng rng(seed);
    return {config, rng};
}

const std::vector<std::string> wider{"decoder.field_width=12", "decoder.feature_channels=10",
                                     "decoder.block_channels=[9,7]", "decoder.mask_channels=3"};

std::string refusal(const std::vector<std::string>& settings) {
    const ScratchFolder folder;
    deep_model(3).save(folder / "narrow.safetensors");
    std::string message = error_message<ConfigError>(
        [&] { widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", settings); });
    CHECK_FALSE(std::filesystem::exists(folder / "wide.safetensors"));
    return message;
}

}  // namespace

TEST_CASE("a widened model makes the same codes and images", "[model]") {
    const ScratchFolder folder;
    const Model narrow = deep_model(3);
    narrow.save(folder / "narrow.safetensors");
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", wider);
    const Model wide = Model::load(folder / "wide.safetensors");
    CHECK(wide.config().decoder.field_width == 12);
    CHECK(wide.config().decoder.block_channels == std::vector<std::int64_t>{9, 7});

    const Codes codes = random_codes(1, 5);
    const ViewOptions options{.samples_per_ray = 6, .mask = true, .depth = true};
    const Camera camera = model_camera(narrow, 0.3, 0.1, 0.0);
    const View before = render_view(narrow, codes, 0, camera, options);
    const View after = render_view(wide, codes, 0, camera, options);
    CHECK(check_close(after.image, before.image, 1e-5).passed);
    CHECK(check_close(after.mask, before.mask, 1e-5).passed);
    CHECK(check_close(after.depth, before.depth, 1e-5).passed);
    for (const Parameter& parameter : narrow.parameters().all())
        if (parameter.name().starts_with("encoder."))
            for (const Parameter& other : wide.parameters().all())
                if (other.name() == parameter.name())
                    CHECK(identical(other.variable().value(), parameter.variable().value()));
}

TEST_CASE("every new channel of a widened model can be learnt", "[model]") {
    const ScratchFolder folder;
    deep_model(3).save(folder / "narrow.safetensors");
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", wider);
    Model wide = Model::load(folder / "wide.safetensors");
    wide.parameters().set_trainable("decoder.", true);
    const Decoded face = wide.decoder()(random_codes(1, 5), {model_camera(wide, 0.3, 0.1, 0.0)},
                                        {.samples_per_ray = 6, .mask = true});
    const std::vector<Parameter> parameters = wide.parameters().trainable();
    const Variable loss = mean(square(face.images.back())) + mean(square(face.mask_logit));
    const std::vector<Variable> gradients = grad(loss, variables_of(parameters));
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        // The columns that read new channels are zero at first and must get gradients.
        const std::string& name = parameters[i].name();
        if (name != "decoder.block32.modulated0.weight" && name != "decoder.field.layer1.weight")
            continue;
        const Tensor& gradient = gradients[i].value();
        const std::vector<double> values = gradient.to_vector();
        const auto columns = static_cast<std::size_t>(gradient.shape(1));
        for (std::size_t column = 0; column < columns; ++column) CHECK(values[column] != 0.0);
    }
}

TEST_CASE("what a model is not widened by is refused", "[model]") {
    CHECK_THAT(refusal({"decoder.frequencies=3"}), Catch::StartsWith("widening changes"));
    CHECK_THAT(refusal({"encoder.head_width=16"}), Catch::StartsWith("widening changes"));
    CHECK_THAT(refusal({"decoder.field_width=4"}), Catch::StartsWith("widening needs"));
    CHECK_THAT(refusal({"decoder.block_channels=[9]"}), Catch::StartsWith("widening needs"));
}
