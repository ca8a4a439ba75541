#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "core/autograd/grad.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "core/ops/ops.h"
#include "nn/models/perceptual/lpips.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

constexpr const char* off_switch = "loss.weight = 0";

Lpips random_lpips(const std::string& network) {
    return {{.network = network, .trunk = "random", .heads = "random"}, off_switch};
}

/// Numbers in [low, high) as tests/golden/make_lpips_vectors.py makes them: a finaliser of the index.
Tensor formula(std::uint32_t stream, const Shape& shape, double low, double high) {
    Tensor result(shape, DType::float64);
    std::uint32_t index = stream << 24U;
    for (double& value : result.mutable_values<double>()) {
        std::uint32_t x = index++;
        x = (x ^ (x >> 16U)) * 0x85EBCA6BU;
        x = (x ^ (x >> 13U)) * 0xC2B2AE35U;
        x ^= x >> 16U;
        value = low + (high - low) * std::ldexp(static_cast<double>(x), -32);
    }
    return result;
}

/// In PyTorch's order of elements.
Tensor formula_weight(std::uint32_t stream, const Shape& shape, bool head) {
    if (head) return formula(stream, shape, 0.0, 1.0);
    if (shape.rank() != 4) return formula(stream, shape, -0.1, 0.1);
    const double bound = std::sqrt(6.0 / static_cast<double>(shape.product(1, 4)));
    const Tensor published = formula(stream, {shape[0], shape[3], shape[1], shape[2]}, -bound, bound);
    return permute(published, {0, 2, 3, 1}).value();
}

Lpips formula_lpips(const std::string& network, DType dtype) {
    Lpips lpips = random_lpips(network);
    std::uint32_t stream = 0;
    lpips.parameters().convert(dtype);
    for (const Parameter& parameter : lpips.parameters().all())
        parameter.set_value(
            formula_weight(stream++, parameter.variable().shape(), parameter.name().starts_with("heads.")).to(dtype));
    return lpips;
}

void compare_with_pytorch(const std::string& network, DType dtype, double tolerance) {
    INFO(network << ", " << dtype);
    const TensorFile file = read_tensor_file(STYMO_SOURCE_DIR "/tests/golden/lpips_vectors.safetensors");
    const Tensor& dL_da = file.tensors.at(network + ".dL_da");
    const Tensor& expected = file.tensors.at(network + ".terms");
    const Lpips lpips = formula_lpips(network, dtype);
    const Variable a = Variable::leaf(formula(254, dL_da.shape(), -1.0, 1.0).to(dtype));
    const Variable b(formula(255, dL_da.shape(), -1.0, 1.0).to(dtype));
    const Lpips::Features features = lpips.features(a);
    const Lpips::Features target = lpips.features(b);
    const std::vector<Variable> terms = lpips.terms(features, target);
    REQUIRE(static_cast<std::int64_t>(terms.size()) == expected.shape(0));
    for (std::size_t k = 0; k < terms.size(); ++k) {
        const auto row = static_cast<std::int64_t>(k);
        const CloseReport report =
            check_close(terms[k].value(), slice(expected, 0, row, row + 1).value().reshaped({expected.shape(1)}), tolerance);
        INFO("term " << k << ": " << report.message);
        CHECK(report.passed);
    }
    const CloseReport report = check_close(grad(sum(lpips.distance(features, target)), a).value(), dL_da, tolerance);
    INFO(report.message);
    CHECK(report.passed);
}

fs::path shared_folder() {
    const char* variable = std::getenv("STYMO_SHARED");
    return variable != nullptr ? fs::path(variable) : fs::path(STYMO_SOURCE_DIR) / "../shared";
}

Tensor picture_batch(const fs::path& path) {
    const Tensor image = read_image(path);
    return affine(image.reshaped({1, image.shape(0), image.shape(1), 3}), 2.0, -1.0).value();
}

}  // namespace

TEST_CASE("LPIPS and its gradient agree with PyTorch for every trunk", "[lpips][torch]") {
    for (const std::string& network : lpips_networks()) {
        compare_with_pytorch(network, DType::float64, 1e-8);
        compare_with_pytorch(network, DType::float32, 1e-4);
    }
}

TEST_CASE("LPIPS with the published SqueezeNet and heads gives the published numbers", "[lpips]") {
    const fs::path shared = shared_folder();
    const fs::path trunk = shared / "weights/squeezenet1_1.safetensors";
    if (!fs::exists(trunk) || !fs::exists(shared / "data/reference.json")) {
        std::cout << "skipped: no shared data\n";
        return;
    }
    const Lpips lpips({.network = "squeezenet1_1",
                       .trunk = trunk.string(),
                       .heads = (shared / "weights/lpips_heads_v0.1.safetensors").string()},
                      off_switch);
    CHECK_FALSE(lpips.random());
    CHECK(lpips.label() == "squeezenet1_1");
    const nlohmann::json reference = nlohmann::json::parse(read_text_file(shared / "data/reference.json"))["lpips_squeeze"];
    const Lpips::Features target = lpips.features(picture_batch(shared / "data/lpips_example/ex_ref.png"));
    for (const auto& [name, total] : {std::pair{"ex_p0", 0.711211}, std::pair{"ex_p1", 0.147935}}) {
        const Lpips::Features features =
            lpips.features(picture_batch(shared / "data/lpips_example" / (std::string(name) + ".png")));
        const std::vector<double> expected = reference[std::string("ex_ref/") + name].get<std::vector<double>>();
        const std::vector<Variable> terms = lpips.terms(target, features);
        REQUIRE(terms.size() == expected.size());
        for (std::size_t k = 0; k < terms.size(); ++k) CHECK(terms[k].value().item() == Approx(expected[k]).margin(1e-6));
        CHECK(lpips.distance(target, features).value().item() == Approx(total).margin(1e-6));
    }
}
