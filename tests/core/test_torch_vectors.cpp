#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "core/autograd/grad.h"
#include "core/io/tensor_file.h"
#include "core/op_cases.h"
#include "core/ops/ops.h"
#include "support/check_close.h"

using namespace stymo;
using namespace stymo::test;

namespace {

const TensorFile& vectors() {
    static const TensorFile file =
        read_tensor_file(STYMO_SOURCE_DIR "/tests/golden/op_vectors.safetensors");
    return file;
}

/// function(i + shift) at element i: the cotangents and directions of
/// tests/golden/make_op_vectors.py.
Variable wave(double (*function)(double), const Variable& like, double shift) {
    Tensor values(like.shape(), DType::float64);
    double i = shift;
    for (double& value : values.mutable_values<double>()) value = function(i++);
    return values.to(like.dtype());
}

std::map<std::string, Tensor> computed(const OpCase& row, DType dtype) {
    std::vector<Variable> xs;
    for (std::size_t k = 0; k < row.inputs.size(); ++k) {
        xs.push_back(
            Variable::leaf(vectors().tensors.at(row.name() + "/x" + std::to_string(k)).to(dtype)));
    }
    const Variable y = row.function(xs);
    const Variable dL_dy = wave(std::cos, y, 1.0);
    const std::vector<Variable> first = grad(y, xs, {.create_graph = true, .dL_dy = dL_dy});
    Variable contracted = Tensor::scalar(0.0, dtype);
    for (std::size_t k = 0; k < first.size(); ++k) {
        contracted =
            contracted + sum(first[k] * wave(std::sin, first[k], 1.0 + static_cast<double>(k)));
    }
    const std::vector<Variable> second = grad(contracted, xs);
    std::map<std::string, Tensor> results{{"/y", y.value()}};
    for (std::size_t k = 0; k < xs.size(); ++k) {
        results["/dx" + std::to_string(k)] = first[k].value();
        results["/ddx" + std::to_string(k)] = second[k].value();
    }
    return results;
}

void compare_all(DType dtype, double tolerance) {
    for (const OpCase& row : op_cases()) {
        INFO(row.name());
        REQUIRE(vectors().tensors.contains(row.name() + "/y"));
        for (const auto& [key, value] : computed(row, dtype)) {
            const CloseReport report =
                check_close(value, vectors().tensors.at(row.name() + key), tolerance);
            INFO(key << ": " << report.message);
            CHECK(report.passed);
        }
    }
}

}  // namespace

TEST_CASE("Values, first and second gradients agree with PyTorch in float64", "[ops][torch]") {
    compare_all(DType::float64, 1e-10);
}

TEST_CASE("Values, first and second gradients agree with PyTorch in float32", "[ops][torch]") {
    compare_all(DType::float32, 1e-5);
}

TEST_CASE("Every PyTorch vector belongs to a row of the table and every row has its vectors",
          "[ops][torch]") {
    std::set<std::string> expected;
    for (const OpCase& row : op_cases()) {
        expected.insert(row.name() + "/y");
        for (std::size_t k = 0; k < row.inputs.size(); ++k) {
            for (const char* kind : {"/x", "/dx", "/ddx"})
                expected.insert(row.name() + kind + std::to_string(k));
            INFO(row.name() << ", input " << k);
            const auto input = vectors().tensors.find(row.name() + "/x" + std::to_string(k));
            REQUIRE(input != vectors().tensors.end());
            CHECK(input->second.shape() == row.inputs[k].shape);
        }
    }
    for (const auto& [key, tensor] : vectors().tensors) {
        INFO(key);
        CHECK(expected.erase(key) == 1);
    }
    INFO("first row without its vector: " << (expected.empty() ? "" : *expected.begin()));
    CHECK(expected.empty());
}
