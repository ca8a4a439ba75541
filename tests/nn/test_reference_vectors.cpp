#include <catch2/catch.hpp>
#include <filesystem>

#include "core/autograd/grad.h"
#include "core/io/tensor_file.h"
#include "core/ops/ops.h"
#include "nn/layers/modulated_linear.h"
#include "nn/layers/render_block.h"
#include "support/check_close.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_nn_vectors.py.
namespace {

constexpr double tolerance = 1e-10;

struct Vectors {
    TensorFile file = read_tensor_file(std::filesystem::path(STYMO_SOURCE_DIR) /
                                       "tests/golden/nn_vectors.safetensors");
    std::string prefix;

    [[nodiscard]] const Tensor& operator()(const std::string& name) const {
        return file.tensors.at(prefix + name);
    }
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
    for (const auto& [name, activation] :
         {std::pair{"sine", Activation::sine}, std::pair{"leaky", Activation::leaky_relu}}) {
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
