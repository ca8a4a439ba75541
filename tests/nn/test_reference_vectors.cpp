#include <catch2/catch.hpp>
#include <filesystem>

#include "core/autograd/grad.h"
#include "core/io/tensor_file.h"
#include "core/ops/ops.h"
#include "nn/layers/modulated_linear.h"
#include "nn/layers/upsampler.h"
#include "nn/models/decoder.h"
#include "support/check_close.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_nn_vectors.py.
namespace {

constexpr double tolerance = 1e-10;

struct Vectors {
    TensorFile file = read_tensor_file(std::filesystem::path(STYMO_SOURCE_DIR) / "tests/golden/nn_vectors.safetensors");
    std::string prefix;

    [[nodiscard]] const Tensor& operator()(const std::string& name) const { return file.tensors.at(prefix + name); }
    void check(const std::string& name, const Variable& actual) const {
        const CloseReport report = check_close(actual.value(), (*this)(name), tolerance);
        INFO(prefix << name << ": " << report.message);
        CHECK(report.passed);
    }
};

/// Sets every parameter from the file and converts to float64.
void load(ParameterStore& store, const TensorFile& file) {
    store.load(file, "nn_vectors.safetensors");
    store.convert(DType::float64);
}

const Variable& parameter(const ParameterStore& store, const std::string& name) {
    for (const Parameter& each : store.all()) {
        if (each.name() == name) return each.variable();
    }
    throw std::runtime_error("no parameter " + name);
}

}  // namespace

TEST_CASE("the modulated layer and its gradients agree with PyTorch") {
    for (const auto& [name, activation] : {std::pair{"sine", Activation::sine}, std::pair{"leaky", Activation::leaky_relu}}) {
        const Vectors vectors{.prefix = std::string(name) + "."};
        Rng rng(1);
        ParameterStore store;
        const ModulatedLinear layer(store, name, 5, 4, 3, activation, rng);
        load(store, vectors.file);
        const Variable x = Variable::leaf(vectors("x")), w = Variable::leaf(vectors("w"));
        const Variable y = layer(x, w);
        vectors.check("y", y);
        vectors.check("y", layer.reference(x, w));
        const std::vector<Variable> xs{x, w, parameter(store, vectors.prefix + "weight")};
        const std::vector<Variable> gradients = grad(y, xs, {.dL_dy = vectors("dL_dy")});
        vectors.check("dL_dx", gradients[0]);
        vectors.check("dL_dw", gradients[1]);
        vectors.check("dL_dweight", gradients[2]);
    }
}

TEST_CASE("the upsampler and its gradient agree with PyTorch") {
    const Vectors vectors{.prefix = "upsampler."};
    Rng rng(1);
    ParameterStore store;
    const Upsampler upsampler(store, "upsampler", 3, rng);
    load(store, vectors.file);
    const Variable x = Variable::leaf(vectors("x"));
    const Variable y = upsampler(x);
    vectors.check("y", y);
    vectors.check("dL_dx", grad(y, x, {.dL_dy = vectors("dL_dy")}));
}

TEST_CASE("a tiny decoder with its rays, images, mask and gradients agrees with PyTorch") {
    const Vectors vectors{.prefix = "case."};
    DecoderConfig config;
    config.rays.rays_per_side = 4;
    config.resolution = 16;
    config.field_width = 8;
    config.field_layers = 4;
    config.feature_channels = 6;
    config.frequencies = 2;
    config.block_channels = {5, 4};
    config.mask_channels = 3;
    config.mapping_layers = 2;
    Rng rng(1);
    ParameterStore store;
    const Decoder decoder(config, store, "decoder", rng);
    load(store, vectors.file);

    std::vector<Camera> cameras;
    const std::span<const double> poses = vectors("poses").values<double>();
    for (std::size_t i = 0; i < poses.size(); i += 6) {
        const Pose pose{poses[i], poses[i + 1], poses[i + 2], {poses[i + 3], poses[i + 4], poses[i + 5]}};
        cameras.push_back(camera_from_pose(pose, {}));
    }
    Codes z;
    for (std::size_t i = 0; i < 4; ++i) z.groups[i] = Variable::leaf(vectors(std::string("z.") + code_names[i]));
    const Decoded decoded = decoder(z, cameras, {.samples_per_ray = 5, .mask = true});
    vectors.check("feature_map", decoded.feature_map);
    vectors.check("image8", decoded.images.at(0));
    vectors.check("image16", decoded.images.at(1));
    vectors.check("mask_logit", decoded.mask_logit);

    Variable loss = mean(square(decoded.feature_map)) + mean(square(decoded.mask_logit));
    for (const Variable& image : decoded.images) loss = loss + mean(square(image));
    std::vector<Variable> xs(z.groups.begin(), z.groups.end());
    xs.push_back(parameter(store, "decoder.field.layer0.weight"));
    const std::vector<Variable> gradients = grad(loss, xs);
    for (std::size_t i = 0; i < 4; ++i) vectors.check(std::string("dL_dz.") + code_names[i], gradients[i]);
    vectors.check("dL_dweight", gradients[4]);
}
