#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "apps/weights/derived_models.h"
#include "core/autograd/grad.h"
#include "core/io/scratch_folder.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/resample.h"
#include "nn/layers/render_block.h"
#include "nn/models/code_file.h"
#include "nn/models/face_batch.h"
#include "nn/realtime/view.h"
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

std::map<std::string, Tensor> values_of(const Model& model) {
    std::map<std::string, Tensor> values;
    for (const Parameter& parameter : model.parameters().all())
        values.emplace(parameter.name(), parameter.variable().value());
    return values;
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
    CHECK(model_mark(folder / "wide.safetensors") == model_mark(folder / "narrow.safetensors"));
    CHECK(wide.config().decoder.block_channels == std::vector<std::int64_t>{9, 7});

    const Codes codes = random_codes(1, 5);
    const ViewOptions options{.samples_per_ray = 6, .mask = true, .depth = true};
    const Camera camera = model_camera(narrow, 0.3, 0.1, 0.0);
    const View before = render_view(narrow, codes, 0, camera, options);
    const View after = render_view(wide, codes, 0, camera, options);
    CHECK(check_close(after.image, before.image, 1e-5).passed);
    CHECK(check_close(after.mask, before.mask, 1e-5).passed);
    CHECK(check_close(after.depth, before.depth, 1e-5).passed);
    const std::map<std::string, Tensor> before_values = values_of(narrow);
    std::size_t unchanged = 0;
    for (const auto& [name, value] : values_of(wide)) {
        if (!name.starts_with("encoder.")) continue;
        ++unchanged;
        CHECK(identical(value, before_values.at(name)));
    }
    CHECK(unchanged > 0);
}

TEST_CASE("a model with an identity backbone added gives the same codes but new identities",
          "[model]") {
    const ScratchFolder folder;
    const Model narrow = deep_model(3);
    narrow.save(folder / "narrow.safetensors");
    const std::vector<std::string> identity{"encoder.identity_backbone=mobilefacenet",
                                            "encoder.identity_weights=random"};
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", identity);
    const Model wide = Model::load(folder / "wide.safetensors");
    CHECK(wide.config().encoder.identity_backbone == "mobilefacenet");
    Rng rng(4);
    const Variable image(rng.normal({1, 32, 32, 3}, 0.0, 0.5));
    const Codes before = narrow.encoder()(image);
    const Codes after = wide.encoder()(image);
    for (std::size_t i = 1; i < before.groups.size(); ++i)
        CHECK(check_close(after.groups[i].value(), before.groups[i].value(), 1e-5).passed);
    const Shape read = values_of(wide).at("encoder.heads.id.wide.weight").shape();
    CHECK(read[1] == 128);
    CHECK_THAT(refusal({"encoder.identity_backbone=mobilefacenet"}),
               Catch::Contains("encoder.identity_weights: no weights for mobilefacenet"));
}

TEST_CASE("an expression backbone is added to a model that has one of identity", "[model]") {
    const ScratchFolder folder;
    const std::vector<std::string> identity{"encoder.identity_backbone=mobilefacenet",
                                            "encoder.identity_weights=random"};
    const std::vector<std::string> expression{"encoder.expression_backbone=landmarks",
                                              "encoder.expression_weights=random"};
    deep_model(3).save(folder / "narrow.safetensors");
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", identity);
    widen_model(folder / "wide.safetensors", folder / "both.safetensors", expression);
    const Model wide = Model::load(folder / "wide.safetensors");
    const Model both = Model::load(folder / "both.safetensors");
    const Variable image(Rng(4).normal({1, 32, 32, 3}, 0.0, 0.5));
    const Codes before = wide.encoder()(image);
    const Codes after = both.encoder()(image);
    for (const std::size_t i : {0, 2, 3})
        CHECK(check_close(after.groups[i].value(), before.groups[i].value(), 1e-5).passed);
    CHECK_FALSE(check_close(after.expression().value(), before.expression().value(), 1e-5).passed);
    CHECK(values_of(both).at("encoder.heads.expr.wide.weight").shape()[1] == 192);
}

TEST_CASE("an encoder with residual blocks and more for identity gives the same codes", "[model]") {
    const ScratchFolder folder;
    const std::vector<std::string> identity{"encoder.identity_backbone=mobilefacenet",
                                            "encoder.identity_weights=random"};
    const std::vector<std::string> larger{"encoder.backbone=small_residual",
                                          "encoder.identity_from_both=true"};
    deep_model(3).save(folder / "narrow.safetensors");
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", identity);
    widen_model(folder / "wide.safetensors", folder / "larger.safetensors", larger);
    const Model wide = Model::load(folder / "wide.safetensors");
    const Model enlarged = Model::load(folder / "larger.safetensors");
    const Variable image(Rng(4).normal({1, 64, 64, 3}, 0.0, 0.5));
    const Codes before = wide.encoder()(image);
    const Codes after = enlarged.encoder()(image);
    for (std::size_t i = 0; i < before.groups.size(); ++i)
        CHECK(check_close(after.groups[i].value(), before.groups[i].value(), 1e-5).passed);
    CHECK(values_of(enlarged).at("encoder.heads.id.wide.weight").shape()[1] == 128 + 256);
    CHECK(enlarged.parameters().element_count("encoder.backbone.residual") == 479'872);
    CHECK_THAT(refusal({"encoder.backbone=landmarks"}), Catch::StartsWith("widening changes"));
}

TEST_CASE("corrections that are added to a model change no code before they learn", "[model]") {
    const ScratchFolder folder;
    deep_model(3).save(folder / "narrow.safetensors");
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors",
                std::vector<std::string>{"encoder.corrections=2"});
    const Model narrow = Model::load(folder / "narrow.safetensors");
    const Model wide = Model::load(folder / "wide.safetensors");
    REQUIRE(wide.corrector() != nullptr);
    Face face;
    face.image = Rng(4).uniform({32, 32, 3}, 0.0, 1.0);
    face.mask = Tensor::full({32, 32, 1}, 1.0);
    const FaceBatch batch = make_batch({&face, 1}, 16);
    CHECK(identical(joined(face_codes(narrow, batch)).value(),
                    joined(face_codes(wide, batch)).value()));
    const auto widen = [&](const std::string& setting) {
        widen_model(folder / "wide.safetensors", folder / "other.safetensors",
                    std::vector<std::string>{setting});
    };
    widen("encoder.corrections=3");
    CHECK(Model::load(folder / "other.safetensors").config().encoder.corrections == 3);
    CHECK_THROWS_AS(widen("encoder.corrections=0"), ConfigError);
}

TEST_CASE("a number of channels that no block had is that of the new block", "[model]") {
    const ScratchFolder folder;
    ModelConfig config = deep_model(3).config();
    config.decoder.block_channels = {6, 4, 3};
    config.reconstruction.resolution_weights = {1.0, 1.0, 1.0};
    Rng rng(3);
    Model(config, rng).save(folder / "small.safetensors");
    widen_model(folder / "small.safetensors", folder / "large.safetensors",
                std::vector<std::string>{"decoder.resolution=64"});
    const Model large = Model::load(folder / "large.safetensors");
    CHECK(large.config().decoder.block_channels == std::vector<std::int64_t>{6, 4, 3});
    const View view = render_view(large, random_codes(1, 5), 0, model_camera(large, 0.3, 0.1, 0.0),
                                  {.samples_per_ray = 6});
    CHECK(view.image.shape() == Shape{64, 64, 3});
}

TEST_CASE("a model with a block more enlarges the images of before and can learn", "[model]") {
    const ScratchFolder folder;
    const Model small = deep_model(3);
    small.save(folder / "small.safetensors");
    const std::vector<std::string> finer{"decoder.resolution=64", "decoder.block_channels=[6,4,3]",
                                         "reconstruction.resolution_weights=[1,1,1]"};
    widen_model(folder / "small.safetensors", folder / "large.safetensors", finer);
    Model large = Model::load(folder / "large.safetensors");
    large.parameters().set_trainable("decoder.", true);
    const Codes codes = random_codes(1, 5);
    const std::vector<Camera> cameras{model_camera(small, 0.3, 0.1, 0.0)};
    const DecodeOptions options{.samples_per_ray = 6, .mask = true};
    const Decoded before = small.decoder()(codes, cameras, options);
    const Decoded after = large.decoder()(codes, cameras, options);
    REQUIRE(after.images.size() == 3);
    CHECK(check_close(after.images[1].value(), before.images[1].value(), 1e-5).passed);
    // The sum of colours is enlarged before its tanh.
    const Variable image = before.images[1];
    const Variable sum = log((image + 1.0) / (image * -1.0 + 1.0)) * 0.5;
    CHECK(check_close(after.images[2].value(), tanh(upsample_smoothly(sum)).value(), 1e-4).passed);
    CHECK(check_close(after.mask_logit.value(), resize_bilinear(before.mask_logit, 64, 64).value(),
                      1e-5)
              .passed);
    const std::vector<Parameter> parameters = large.parameters().trainable();
    const Variable loss = mean(square(after.images.back())) + mean(square(after.mask_logit));
    const std::vector<Variable> gradients = grad(loss, variables_of(parameters));
    std::size_t began_as_zero = 0;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const std::string& name = parameters[i].name();
        if (name != "decoder.block64.to_rgb.weight" && name != "decoder.mask.lateral64.weight")
            continue;
        ++began_as_zero;
        INFO(name);
        double gradient = 0.0;
        for (const double slope : gradients[i].value().to_vector()) gradient += std::abs(slope);
        CHECK(gradient > 0.0);
    }
    CHECK(began_as_zero == 2);
}

TEST_CASE("every new channel of a widened model can be learnt", "[model]") {
    const ScratchFolder folder;
    const Model narrow = deep_model(3);
    narrow.save(folder / "narrow.safetensors");
    widen_model(folder / "narrow.safetensors", folder / "wide.safetensors", wider);
    Model wide = Model::load(folder / "wide.safetensors");
    wide.parameters().set_trainable("decoder.", true);
    const Decoded face = wide.decoder()(random_codes(1, 5), {model_camera(wide, 0.3, 0.1, 0.0)},
                                        {.samples_per_ray = 6, .mask = true});
    const std::vector<Parameter> parameters = wide.parameters().trainable();
    const Variable loss = mean(square(face.images.back())) + mean(square(face.mask_logit));
    const std::vector<Variable> gradients = grad(loss, variables_of(parameters));
    const std::map<std::string, Tensor> before = values_of(narrow);
    std::size_t widened_inputs = 0;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const std::string& name = parameters[i].name();
        const Shape& old = before.at(name).shape();
        const Shape& now = parameters[i].variable().shape();
        if (now.rank() != 2 || now[1] == old[1]) continue;
        ++widened_inputs;
        // What was there reads the new channels with zero, and must get gradients to learn from.
        const std::vector<double> weights = parameters[i].variable().value().to_vector();
        const std::vector<double> slopes = gradients[i].value().to_vector();
        for (std::int64_t column = old[1]; column < now[1]; ++column) {
            INFO(name << " column " << column);
            double gradient = 0.0;
            for (std::int64_t row = 0; row < old[0]; ++row) {
                const auto at = static_cast<std::size_t>(row * now[1] + column);
                CHECK(weights[at] == 0.0);
                gradient += std::abs(slopes[at]);
            }
            CHECK(gradient > 0.0);
        }
    }
    // The field's layers but the first, its density and two feature layers; of each of two blocks
    // four layers; two laterals and the logit of the mask.
    CHECK(widened_inputs == 17);
}

TEST_CASE("what a model is not widened by is refused", "[model]") {
    CHECK_THAT(refusal({"decoder.frequencies=3"}), Catch::StartsWith("widening changes"));
    CHECK_THAT(refusal({"encoder.head_width=16"}), Catch::StartsWith("widening changes"));
    CHECK_THAT(refusal({"decoder.field_width=4"}), Catch::StartsWith("widening needs"));
    CHECK_THAT(refusal({"decoder.resolution=16"}), Catch::StartsWith("widening changes"));
    CHECK_THAT(refusal({"decoder.resolution=64"}), Catch::Contains("block_channels"));
    CHECK_THAT(refusal({"decoder.resolution=64", "decoder.block_channels=[6,4,3]"}),
               Catch::Contains("reconstruction.resolution_weights"));
    CHECK_THAT(refusal({"decoder.resolution=48"}), Catch::Contains("decoder.resolution 48"));
    CHECK_THAT(refusal({"decoder.block_channels=[6,4,3]"}), Catch::StartsWith("widening needs"));
    CHECK_THAT(refusal({"reconstruction.resolution_weights=[1,2]"}),
               Catch::StartsWith("widening changes"));
    CHECK_THAT(refusal({"decoder.block_channels=[9]"}), Catch::StartsWith("widening needs"));
}
