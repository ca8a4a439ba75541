#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/ops/ops.h"
#include "nn/layers/batch_norm.h"
#include "nn/layers/conv_layer.h"
#include "nn/models/encoder.h"
#include "nn/pretrained/landmark_network.h"
#include "shared_data.h"
#include "support/check_close.h"
#include "support/error_message.h"

using namespace stymo;

namespace {

struct BackboneRow {
    const char* name;
    std::int64_t input_side;
    std::int64_t embedding_size;
    std::int64_t parameters;  ///< counted by hand from the published layer table, batch-norm
                              ///< statistics included
    bool large = false;       ///< made and run by the slow tests only
};

// A registered backbone without a row here fails "every registered backbone has a row".
const std::vector<BackboneRow> rows{
    {"iresnet100", 112, 512, 65'156'160 + 69'632, true},
    {"iresnet50", 112, 512, 43'590'848 + 38'144, true},
    {"landmarks", 80, 192, 1'280'784},
    {"mobilefacenet", 112, 128, 1'019'648},
    {"small_conv", 64, 256, 1'240'896},
    {"small_residual", 64, 256, 1'720'768},
};

std::vector<BackboneRow> rows_where(bool large) {
    std::vector<BackboneRow> result;
    std::ranges::copy_if(rows, std::back_inserter(result),
                         [&](const BackboneRow& row) { return row.large == large; });
    return result;
}

/// Random image in [-1, 1].
Variable image_of(std::int64_t batch, std::int64_t side, std::uint64_t seed,
                  DType dtype = DType::float32) {
    Rng rng(seed);
    return Variable(rng.uniform({batch, side, side, 3}, -1.0, 1.0, dtype));
}

double largest(const Tensor& tensor) {
    double result = 0.0;
    for (const double value : tensor.to_vector()) result = std::max(result, std::abs(value));
    return result;
}

Variable sum_of_squares(const Codes& codes) {
    Variable total = sum(square(codes.groups[0]));
    for (std::size_t i = 1; i < codes.groups.size(); ++i)
        total = total + sum(square(codes.groups[i]));
    return total;
}

void check_size(const BackboneRow& row) {
    INFO("backbone " << row.name);
    ParameterStore store;
    Rng rng(1);
    const auto backbone = make_backbone(row.name, store, "backbone.", rng);
    CHECK(backbone->input_side() == row.input_side);
    CHECK(backbone->embedding_size() == row.embedding_size);
    CHECK(store.element_count("backbone.") == row.parameters);
    for (const std::int64_t side : {row.input_side, std::int64_t{80}}) {
        const Variable embedding = (*backbone)(image_of(2, side, 2));
        CHECK(embedding.shape() == Shape{2, row.embedding_size});
        CHECK(embedding.value().all_finite());
    }
}

void check_gradient_arrives(const BackboneRow& row) {
    INFO("backbone " << row.name);
    ParameterStore store;
    Rng rng(6);
    const Encoder encoder({.backbone = row.name, .head_width = 32}, store, "encoder", rng);
    const auto trainable = store.trainable();
    std::vector<Variable> leaves;
    for (const Parameter& parameter : trainable) {
        CHECK(parameter.name().find("running_") == std::string::npos);
        leaves.push_back(parameter.variable());
    }
    const std::vector<Variable> gradients =
        grad(sum_of_squares(encoder(image_of(1, 64, 7))), leaves);
    for (std::size_t i = 0; i < gradients.size(); ++i) {
        INFO("parameter " << trainable[i].name());
        CHECK(gradients[i].value().all_finite());
        CHECK(largest(gradients[i].value()) > 0.0);
    }
}

void check_codes_near_zero(const BackboneRow& row) {
    INFO("backbone " << row.name);
    ParameterStore store;
    Rng rng(4);
    const Encoder encoder({.backbone = row.name}, store, "encoder", rng);
    const Codes codes = encoder(image_of(2, 64, 5));
    for (std::size_t i = 0; i < codes.groups.size(); ++i)
        CHECK(codes.groups[i].shape() == Shape{2, code_sizes[i]});
    const double mean_square =
        sum_of_squares(codes).value().item() / static_cast<double>(2 * code_size);
    CHECK(mean_square > 0.0);
    CHECK(mean_square < 1.0);
}

}  // namespace

TEST_CASE("every registered backbone has a row in the table of the test", "[encoder]") {
    std::set<std::string> tested;
    for (const BackboneRow& row : rows) tested.insert(row.name);
    for (const std::string& name : backbone_names()) {
        INFO("backbone " << name);
        CHECK(tested.count(name) == 1);
    }
    CHECK(tested.size() == backbone_names().size());
}

TEST_CASE("each backbone has its published size and turns an image of any side into its embedding",
          "[encoder]") {
    for (const BackboneRow& row : rows_where(false)) check_size(row);
}

TEST_CASE(
    "each large backbone has its published size and turns an image of any side into its embedding",
    "[encoder][slow]") {
    for (const BackboneRow& row : rows_where(true)) check_size(row);
}

TEST_CASE("images of a batch do not influence each other's embedding", "[encoder]") {
    for (const BackboneRow& row : rows_where(false)) {
        INFO("backbone " << row.name);
        ParameterStore store;
        Rng rng(1);
        const auto backbone = make_backbone(row.name, store, "backbone.", rng);
        const Variable images = image_of(2, row.input_side, 3);
        const Variable both = (*backbone)(images);
        const Variable second = (*backbone)(slice(images, 0, 1, 2));
        CHECK(largest((slice(both, 0, 1, 2) - second).value()) <
              1e-5 * (1.0 + largest(second.value())));
    }
}

TEST_CASE("the encoder gives four codes near zero at the start", "[encoder]") {
    for (const BackboneRow& row : rows_where(false)) check_codes_near_zero(row);
}

TEST_CASE("the encoder with a large backbone gives four codes near zero at the start",
          "[encoder][slow]") {
    for (const BackboneRow& row : rows_where(true)) check_codes_near_zero(row);
}

TEST_CASE(
    "a gradient reaches every trainable parameter of the encoder, and none of the stored "
    "statistics",
    "[encoder]") {
    for (const BackboneRow& row : rows_where(false)) check_gradient_arrives(row);
}

TEST_CASE("a gradient reaches every trainable parameter of a large encoder", "[encoder][slow]") {
    for (const BackboneRow& row : rows_where(true)) check_gradient_arrives(row);
}

TEST_CASE("the encoder's gradient agrees with finite differences in float64", "[encoder]") {
    for (const BackboneRow& row : rows_where(false)) {
        INFO("backbone " << row.name);
        ParameterStore store;
        Rng rng(8);
        const Encoder encoder({.backbone = row.name, .head_width = 16}, store, "encoder", rng);
        store.convert(DType::float64);
        const Variable image = image_of(1, 64, 9, DType::float64);
        const auto trainable = store.trainable();
        std::vector<Variable> leaves;
        std::vector<Tensor> directions;
        for (const Parameter& parameter : trainable) {
            // Biases of 0 would leave whole regions exactly on the kink of their rectifier.
            const Tensor offset =
                rng.normal(parameter.variable().shape(), 0.0, 0.1, DType::float64);
            parameter.set_value((parameter.variable().detach() + Variable(offset)).value());
            leaves.push_back(parameter.variable());
            // Of length about 1 for each tensor: a longer step would push some of the many
            // rectifiers across their kink.
            const double deviation =
                1.0 / std::sqrt(static_cast<double>(parameter.variable().value().size()));
            directions.push_back(
                rng.normal(parameter.variable().shape(), 0.0, deviation, DType::float64));
        }
        const std::vector<Variable> gradients = grad(sum_of_squares(encoder(image)), leaves);
        double slope = 0.0;
        for (std::size_t i = 0; i < leaves.size(); ++i)
            slope += sum(gradients[i] * Variable(directions[i])).value().item();
        const auto loss_at = [&](double step) {
            for (std::size_t i = 0; i < leaves.size(); ++i)
                trainable[i].set_value(
                    (leaves[i].detach() + Variable(directions[i]) * step).value());
            return sum_of_squares(encoder(image)).value().item();
        };
        constexpr double step = 1e-8;
        const double difference = (loss_at(step) - loss_at(-step)) / (2.0 * step);
        CHECK(difference == Approx(slope).epsilon(1e-4));
    }
}

TEST_CASE("the ArcFace crop shows the backbone the middle 76.5 % of the image and nothing else",
          "[encoder]") {
    const auto codes_of = [](bool arcface_crop, const Variable& image) {
        ParameterStore store;
        Rng rng(16);
        const Encoder encoder(
            {.backbone = "small_conv", .arcface_crop = arcface_crop, .head_width = 16}, store,
            "encoder", rng);
        return encoder(image).groups[0].value().to_vector();
    };
    // The frame is 195.84 of 256 pixels; whole ones come closest with 30 off each side.
    const Variable image = image_of(1, 256, 17);
    const Variable middle = slice(slice(image, 1, 30, 226), 2, 30, 226);
    const Variable reframed = pad(pad(middle, 1, 30, 30), 2, 30, 30);
    CHECK(codes_of(true, image) == codes_of(false, middle));
    CHECK(codes_of(true, image) == codes_of(true, reframed));
    CHECK(codes_of(true, image) != codes_of(false, image));
}

TEST_CASE("mobilefacenet reproduces the reference embedding of its published weights",
          "[encoder]") {
    const auto shared = shared_data();
    if (!shared) return;
    ParameterStore store;
    Rng rng(10);
    const auto backbone = make_backbone("mobilefacenet", store, "backbone.", rng);
    const std::filesystem::path weights = *shared / "weights/mobilefacenet_arcface.safetensors";
    backbone->load_pretrained(read_tensor_file(weights), weights.string());
    // The reference input in [0, 1] is 0.5 + 0.5 sin(0.01 i), so in [-1, 1] it is the sine itself.
    std::vector<float> pixels(112 * 112 * 3);
    for (std::size_t i = 0; i < pixels.size(); ++i)
        pixels[i] = static_cast<float>(std::sin(0.01 * static_cast<double>(i)));
    const std::vector<double> embedding =
        (*backbone)(Variable(Tensor::from({1, 112, 112, 3}, pixels))).value().to_vector();
    const auto reference = nlohmann::json::parse(read_file(*shared / "data/reference.json"))
                               .at("mobilefacenet")
                               .at("embedding_before_normalisation")
                               .get<std::vector<double>>();
    REQUIRE(embedding.size() == reference.size());
    double worst = 0.0;
    for (std::size_t i = 0; i < embedding.size(); ++i)
        worst = std::max(worst, std::abs(embedding[i] - reference[i]));
    CHECK(worst < 1e-4);
}

TEST_CASE("the folded batch norm equals its definition", "[encoder]") {
    ParameterStore store;
    const BatchNorm norm(store, "norm", 2);
    norm.weight().set_value(Tensor::from({2}, std::vector<float>{2.0F, -1.0F}));
    norm.bias().set_value(Tensor::from({2}, std::vector<float>{0.5F, 0.25F}));
    norm.running_mean().set_value(Tensor::from({2}, std::vector<float>{1.0F, -3.0F}));
    norm.running_variance().set_value(Tensor::from({2}, std::vector<float>{4.0F, 0.25F}));
    const std::vector<double> y =
        norm(Variable(Tensor::from({1, 1, 1, 2}, std::vector<float>{5.0F, -2.0F})))
            .value()
            .to_vector();
    CHECK(y[0] == Approx((5.0 - 1.0) / std::sqrt(4.0 + 1e-5) * 2.0 + 0.5));
    CHECK(y[1] == Approx((-2.0 + 3.0) / std::sqrt(0.25 + 1e-5) * -1.0 + 0.25));
}

TEST_CASE("a convolution with a folded normalisation equals the convolution followed by it",
          "[encoder]") {
    for (const ConvLayerOptions& options :
         {ConvLayerOptions{.stride = 2, .groups = 2, .bias = false},
          ConvLayerOptions{.kernel = 1, .padding = 0, .bias = false},
          ConvLayerOptions{.bias = false, .scaling = WeightScaling::equalised}}) {
        ParameterStore store;
        Rng rng(11);
        const ConvLayer layer(store, "conv", 4, 6, options, rng);
        const Variable x(rng.normal({2, 5, 7, 4}, 0.0, 1.0));
        const Variable scale(rng.normal({6}, 1.0, 0.5));
        const Variable shift(rng.normal({6}, 0.0, 1.0));
        CHECK(largest((layer.scaled(x, scale, shift) - (layer(x) * scale + shift)).value()) < 1e-5);
    }
}

TEST_CASE("a pointwise convolution equals the general one", "[encoder]") {
    ParameterStore store;
    Rng rng(12);
    const ConvLayer layer(store, "conv", 5, 3, {.kernel = 1, .padding = 0}, rng);
    layer.bias().set_value(rng.normal({3}, 0.0, 1.0));
    const Variable x(rng.normal({2, 4, 3, 5}, 0.0, 1.0));
    const Variable expected = conv2d(x, layer.weight().variable()) + layer.bias().variable();
    CHECK(largest((layer(x) - expected).value()) < 1e-5);
}

TEST_CASE("groups that do not divide the channels are refused", "[encoder]") {
    ParameterStore store;
    Rng rng(13);
    CHECK_THROWS_AS(ConvLayer(store, "conv", 4, 6, {.groups = 4}, rng), ValueError);
}

TEST_CASE("what is wrong with the backbone or its weights is said in one line with the key",
          "[encoder]") {
    ParameterStore store;
    Rng rng(14);
    const auto made = [&](const EncoderConfig& config) {
        return test::error_message<Error>(
            [&] { const Encoder encoder(config, store, "encoder", rng); });
    };

    const std::string unknown = made({.backbone = "resnet"});
    CHECK_THAT(unknown, Catch::Contains("encoder.backbone") && Catch::Contains("resnet") &&
                            Catch::Contains("mobilefacenet, small_conv"));

    const std::string missing =
        made({.backbone = "mobilefacenet", .backbone_weights = "/nowhere/weights.safetensors"});
    CHECK_THAT(missing, Catch::Contains("encoder.backbone_weights") &&
                            Catch::Contains("/nowhere/weights.safetensors"));
    CHECK(missing.find('\n') == std::string::npos);
}

TEST_CASE("identity is read from both backbones where that is asked", "[encoder]") {
    const auto identities = [](bool from_both) {
        ParameterStore store;
        Rng rng(16);
        const Encoder encoder({.backbone = "small_conv",
                               .head_width = 8,
                               .identity_backbone = "mobilefacenet",
                               .identity_weights = random_backbone,
                               .identity_from_both = from_both},
                              store, "encoder", rng);
        // The frame of the backbone that knows faces ends before the corner, where hair is.
        const Variable image = image_of(1, 64, 17);
        Tensor hair = image.value();
        hair.mutable_values<float>()[0] += 1.0F;
        return std::pair(encoder(image).groups[0].value(),
                         encoder(Variable(hair)).groups[0].value());
    };
    const auto [face, face_with_hair] = identities(false);
    CHECK(test::identical(face, face_with_hair));
    const auto [head, head_with_hair] = identities(true);
    CHECK_FALSE(test::identical(head, head_with_hair));
}

TEST_CASE("identity is read from the identity backbone, texture from both", "[encoder]") {
    ParameterStore store;
    Rng rng(16);
    const Encoder encoder({.backbone = "small_conv",
                           .head_width = 8,
                           .identity_backbone = "mobilefacenet",
                           .identity_weights = random_backbone},
                          store, "encoder", rng);
    const auto named = [&store](const std::string& name) {
        return *std::ranges::find(store.all(), name, &Parameter::name);
    };
    ParameterStore alone;
    const auto network = make_backbone("mobilefacenet", alone, "", rng);
    for (const Parameter& parameter : alone.all())
        parameter.set_value(named("encoder.identity." + parameter.name()).variable().value());
    const Variable image(rng.normal({1, 64, 64, 3}, 0.0, 0.5));
    const std::vector<double> embedding = (*network)(arcface_frame(image)).value().to_vector();
    double square = 0.0;
    for (const double value : embedding) square += value * value;

    // A weight that picks one number gives the codes that the number as a bias gives.
    const auto [name, group, first] = GENERATE(std::tuple{"id", 0, 0}, std::tuple{"tex", 2, 256});
    CAPTURE(name);
    const Parameter weight = named(std::string("encoder.heads.") + name + ".wide.weight");
    const Parameter bias = named(std::string("encoder.heads.") + name + ".wide.bias");
    const std::int64_t columns = first + 128;
    REQUIRE(weight.variable().shape() == Shape{8, columns});
    const auto code = [&, at = static_cast<std::size_t>(group)] {
        return encoder(image).groups[at];
    };
    for (const std::int64_t number : {0, 77}) {
        std::vector<double> pick(static_cast<std::size_t>(8 * columns), 0.0);
        pick[static_cast<std::size_t>(first + number)] = std::sqrt(static_cast<double>(columns));
        weight.set_value(Tensor::from({8, columns}, pick).to(DType::float32));
        bias.set_value(Tensor::zeros({8}));
        const Tensor picked = code().value();
        std::vector<double> value(8, 0.0);
        value[0] = embedding[static_cast<std::size_t>(number)] / std::sqrt(square / 128.0);
        weight.set_value(Tensor::zeros({8, columns}));
        bias.set_value(Tensor::from({8}, value).to(DType::float32));
        CHECK(largest((code() - Variable(picked)).value()) < 1e-4);
    }
    CHECK(named("encoder.heads.expr.wide.weight").variable().shape() == Shape{8, 256});
}

TEST_CASE("without a backbone of its own, expression is read from the trained one", "[encoder]") {
    ParameterStore store;
    Rng rng(19);
    const Encoder encoder({.backbone = "small_conv",
                           .embedding_scale = 3.0,
                           .head_width = 8,
                           .identity_backbone = "mobilefacenet",
                           .identity_weights = random_backbone},
                          store, "encoder", rng);
    const Variable image = image_of(2, 64, 20);
    CHECK(test::identical(encoder.expression(image).value(), encoder(image).expression().value()));
}

TEST_CASE("expression is read from the expression backbone alone", "[encoder]") {
    ParameterStore store;
    Rng rng(17);
    const Encoder encoder({.backbone = "small_conv",
                           .head_width = 8,
                           .expression_backbone = "landmarks",
                           .expression_weights = random_backbone},
                          store, "encoder", rng);
    const Variable image = image_of(1, 64, 18);
    const Codes before = encoder(image);
    CHECK(test::identical(encoder.expression(image).value(), before.expression().value()));
    for (const Parameter& parameter : store.all())
        if (parameter.name().starts_with("encoder.backbone."))
            parameter.set_value(Tensor::zeros(parameter.variable().shape()));
    const Codes after = encoder(image);
    CHECK(test::identical(after.expression().value(), before.expression().value()));
    CHECK_FALSE(test::identical(after.texture().value(), before.texture().value()));
    // It does not see what lies outside the square of the face.
    Tensor hair = image.value();
    std::ranges::fill(hair.mutable_values<float>().first(3UL * 64 * 20), 0.5F);
    CHECK(test::identical(encoder.expression(Variable(hair)).value(), before.expression().value()));
}

TEST_CASE("the landmark backbone is the shipped landmark network before its points", "[encoder]") {
    const std::filesystem::path file =
        STYMO_SOURCE_DIR "/configs/models/landmarks/landmarks.safetensors";
    ParameterStore store;
    Rng rng(18);
    const auto backbone = make_backbone("landmarks", store, "b.", rng);
    backbone->load_pretrained(read_tensor_file(file), file.string());
    ParameterStore network;
    const LandmarkFeatures features(network, "landmarks.", rng);
    network.load(read_tensor_file(file), file.string());
    // The square of a crop of 80 / 0.63 pixels has 80, so nothing is resampled.
    const Variable image = image_of(2, 127, 19);
    const Variable square = slice(slice(image, 1, 42, 122), 2, 24, 104) * 0.5 + 0.5;
    CHECK(test::check_close((*backbone)(image).value(), features(square).value(), 1e-4).passed);
    CHECK_THAT(
        test::error_message<FileError>([&] { backbone->load_pretrained({}, "x.safetensors"); }),
        Catch::Contains("x.safetensors: not a landmark network of stymo"));
}

TEST_CASE("an identity backbone without its weights is refused with the key", "[encoder]") {
    CHECK_THAT(test::error_message<ConfigError>([] {
                   require_backbone_weights(
                       {.backbone = "small_conv", .identity_backbone = "mobilefacenet"});
               }),
               Catch::Contains("encoder.identity_weights: no weights for mobilefacenet"));
    CHECK_NOTHROW(require_backbone_weights({.backbone = "small_conv"}));
    CHECK_THAT(test::error_message<ConfigError>([] {
                   require_backbone_weights(
                       {.backbone = "small_conv", .identity_weights = "mobilefacenet.safetensors"});
               }),
               Catch::Contains("encoder.identity_weights: there is no such network"));
}

TEST_CASE("published weights of the wrong network or shape are refused by name", "[encoder]") {
    ParameterStore store;
    Rng rng(15);
    const auto mobile = make_backbone("mobilefacenet", store, "mobile.", rng);
    CHECK_THAT(
        test::error_message<Error>([&] { mobile->load_pretrained({}, "empty.safetensors"); }),
        Catch::Contains("empty.safetensors") && Catch::Contains("conv1.0.weight"));
    TensorFile transposed;
    transposed.tensors["conv1.0.weight"] = Tensor::zeros({64, 3, 3, 5});
    CHECK_THAT(
        test::error_message<Error>([&] { mobile->load_pretrained(transposed, "x.safetensors"); }),
        Catch::Contains("conv1.0.weight") && Catch::Contains("(64, 3, 3, 5)") &&
            Catch::Contains("(64, 3, 3, 3)"));
    const auto small = make_backbone("small_conv", store, "small.", rng);
    CHECK_THROWS_AS(small->load_pretrained({}, "x.safetensors"), ConfigError);
}
