#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/io/tensor_file.h"
#include "core/ops/ops.h"
#include "nn/pretrained/backbones/iresnet.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/golden.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_iresnet_vectors.py.
namespace {

const IresnetLayout tiny{
    .blocks = {2, 2, 2, 2}, .widths = {4, 6, 8, 10}, .input_side = 32, .embedding_size = 12};
const std::string prefix = "backbone.";

std::filesystem::path golden() {
    return std::filesystem::path(STYMO_SOURCE_DIR) / "tests/golden";
}

/// Embedding, gradient of the input and of every trainable parameter against those of the file,
/// from the file's own weights. Returns the largest relative error.
double check_against(const TensorFile& file, const IresnetLayout& layout, DType dtype,
                     double tolerance) {
    ParameterStore store;
    Rng rng(1);
    const auto backbone = make_iresnet(layout, store, prefix, rng);
    backbone->load_pretrained(file, "vectors");
    store.convert(dtype);
    const auto expected = [&](const std::string& name) {
        return file.tensors.at("vectors." + name);
    };
    double worst = 0.0;
    const auto check = [&](const std::string& name, const Variable& actual) {
        const CloseReport report =
            check_close(actual.value().to(DType::float64), expected(name), tolerance);
        INFO(name << ": " << report.message);
        CHECK(report.passed);
        worst = std::max(worst, report.error);
    };
    const Variable x = Variable::leaf(expected("x").to(dtype));
    const Variable y = (*backbone)(x);
    check("y", y);
    const std::vector<Parameter> parameters = store.trainable();
    std::vector<Variable> xs = variables_of(parameters);
    xs.insert(xs.begin(), x);
    const std::vector<Variable> gradients = grad(y, xs, {.dL_dy = expected("dL_dy").to(dtype)});
    check("dL_dx", gradients[0]);
    for (std::size_t i = 0; i < parameters.size(); ++i)
        check("dL_d." + parameters[i].name().substr(prefix.size()), gradients[i + 1]);
    return worst;
}

}  // namespace

TEST_CASE("a tiny iresnet and all of its gradients agree with PyTorch") {
    const TensorFile file = read_tensor_file(golden() / "iresnet_vectors.safetensors");
    check_against(file, tiny, DType::float64, 1e-8);
    check_against(file, tiny, DType::float32, 1e-4);
}

TEST_CASE("iresnet50 at true size and all of its gradients agree with PyTorch",
          "[agreement][slow]") {
    const auto folder = golden_folder();
    if (!folder) return;
    const TensorFile file = read_tensor_file(*folder / "iresnet50.safetensors");
    for (const auto& [dtype, tolerance] :
         {std::pair{DType::float64, 1e-8}, std::pair{DType::float32, 1e-4}}) {
        const double worst = check_against(file, {.blocks = {3, 4, 14, 3}}, dtype, tolerance);
        std::cout << "agreement | iresnet50/gradient | | " << dtype << " | " << worst << " | |\n";
    }
}

TEST_CASE("an untrained iresnet keeps values of size one, however deep it is") {
    ParameterStore store;
    Rng rng(2);
    const auto backbone =
        make_iresnet({.blocks = {3, 13, 30, 3}, .widths = {8, 8, 16, 16}}, store, prefix, rng);
    const Variable image(rng.uniform({2, 112, 112, 3}, -1.0, 1.0));
    const double mean_square = mean(square((*backbone)(image))).value().item();
    CHECK(mean_square > 0.2);
    CHECK(mean_square < 5.0);
}

TEST_CASE("the last batch norm's weight is saved but never trained") {
    ParameterStore store;
    Rng rng(3);
    const auto backbone = make_iresnet(tiny, store, prefix, rng);
    store.set_trainable(prefix, true);
    for (const Parameter& parameter : store.trainable())
        CHECK(parameter.name() != prefix + "features.weight");
}

TEST_CASE(
    "a file that is not of this iresnet is refused by the name of the first tensor and changes "
    "nothing") {
    ParameterStore store;
    Rng rng(4);
    const auto backbone = make_iresnet(tiny, store, prefix, rng);
    TensorFile before;
    store.save(before);
    TensorFile file = read_tensor_file(golden() / "iresnet_vectors.safetensors");
    file.tensors["fc.weight"] = Tensor::zeros({12, 41});
    const auto message = [&] {
        return error_message<FileError>([&] { backbone->load_pretrained(file, "a.safetensors"); });
    };
    CHECK_THAT(message(), Catch::Contains("a.safetensors") && Catch::Contains("fc.weight") &&
                              Catch::Contains("(12, 41)") && Catch::Contains("(12, 40)"));
    file.tensors.erase("layer3.1.bn3.running_var");
    CHECK_THAT(message(), Catch::Contains("layer3.1.bn3.running_var"));
    for (const Parameter& parameter : store.all())
        CHECK(parameter.variable().value().to_vector() ==
              before.tensors.at(parameter.name()).to_vector());
}

TEST_CASE("an iresnet for a side that it cannot halve four times is refused") {
    ParameterStore store;
    Rng rng(5);
    CHECK_THROWS_AS(make_iresnet({.blocks = {1, 1, 1, 1}, .input_side = 40}, store, prefix, rng),
                    ValueError);
}
