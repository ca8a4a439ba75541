#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "support/array.h"
#include "support/check_close.h"

namespace linalg_size_tests {

using namespace stymo;
using namespace stymo::test;

/// Products larger than the tiles of the kernels, with extents that no tile divides.
namespace {

Tensor transposed(const Tensor& x) {
    const Array array = to_array(x);
    return to_tensor(
        generate({array.extents[0], array.extents[2], array.extents[1]}, [&](const Index& i) {
            return array.at({i[0], i[2], i[1]});
        }));
}

/// a (batch or 1, m, k), b (batch or 1, k, n), in the order of loops of the definition.
Tensor product(const Tensor& a, const Tensor& b) {
    const std::int64_t batch = std::max(a.shape(0), b.shape(0));
    const std::int64_t m = a.shape(1);
    const std::int64_t k = a.shape(2);
    const std::int64_t n = b.shape(2);
    Tensor c = Tensor::zeros({batch, m, n}, DType::float64);
    const double* left = a.values<double>().data();
    const double* right = b.values<double>().data();
    double* out = c.mutable_values<double>().data();
    for (std::int64_t i = 0; i < batch * m; ++i) {
        const double* row = left + (a.shape(0) == 1 ? i % m : i) * k;
        const double* matrix = right + (b.shape(0) == 1 ? 0 : i / m) * k * n;
        for (std::int64_t p = 0; p < k; ++p) {
            for (std::int64_t j = 0; j < n; ++j) out[i * n + j] += row[p] * matrix[p * n + j];
        }
    }
    return c;
}

struct Extents {
    std::int64_t batch_a, batch_b, m, k, n;
};

}  // namespace

TEST_CASE("Products of every size agree with the definition", "[ops][linalg]") {
    Rng rng(5);
    for (const Extents& e :
         {Extents{1, 1, 1, 1, 1}, Extents{1, 1, 1, 700, 1}, Extents{2, 1, 1031, 37, 45},
          Extents{1, 3, 300, 33, 17}, Extents{2, 2, 259, 130, 5}, Extents{1, 1, 7, 20000, 9},
          Extents{2, 2, 3, 16385, 4}}) {
        const Tensor a = rng.uniform({e.batch_a, e.m, e.k}, -1.0, 1.0, DType::float64);
        const Tensor b = rng.uniform({e.batch_b, e.k, e.n}, -1.0, 1.0, DType::float64);
        const Tensor expected = product(a, b);
        for (const bool transpose_a : {false, true}) {
            for (const bool transpose_b : {false, true}) {
                const Tensor left = transpose_a ? transposed(a) : a;
                const Tensor right = transpose_b ? transposed(b) : b;
                for (const DType dtype : {DType::float64, DType::float32}) {
                    const Variable c =
                        matmul(left.to(dtype), right.to(dtype), {transpose_a, transpose_b});
                    const CloseReport report =
                        check_close(c.value(), expected, dtype == DType::float64 ? 1e-12 : 2e-5);
                    INFO(left.shape()
                         << (transpose_a ? "^T x " : " x ") << right.shape()
                         << (transpose_b ? "^T, " : ", ") << dtype << ": " << report.message);
                    CHECK(report.passed);
                }
            }
        }
    }
}

TEST_CASE("The fused layer agrees with its composition at every size", "[ops][linalg]") {
    Rng rng(6);
    for (const Extents& e :
         {Extents{1, 1, 1, 1, 1}, Extents{2, 1, 1031, 37, 45}, Extents{3, 3, 513, 16, 33}}) {
        for (const Activation activation :
             {Activation::none, Activation::sine, Activation::leaky_relu}) {
            for (const bool with_bias : {true, false}) {
                const Variable x =
                    Variable::leaf(rng.uniform({e.batch_a, e.m, e.k}, -1.0, 1.0, DType::float64));
                const Variable weight =
                    Variable::leaf(rng.uniform({e.batch_b, e.n, e.k}, -1.0, 1.0, DType::float64));
                const Variable bias =
                    with_bias ? Variable::leaf(rng.uniform({e.n}, -1.0, 1.0, DType::float64))
                              : Variable();
                std::vector<Variable> inputs{x, weight};
                if (with_bias) inputs.push_back(bias);
                const Variable fused = linear(x, weight, bias, activation);
                const Variable composed = linear_reference(x, weight, bias, activation);
                const Variable dL_dy = rng.uniform(fused.shape(), -1.0, 1.0, DType::float64);
                const auto of_fused = grad(fused, inputs, {.create_graph = false, .dL_dy = dL_dy});
                const auto of_composed =
                    grad(composed, inputs, {.create_graph = false, .dL_dy = dL_dy});
                CloseReport report = check_close(fused.value(), composed.value(), 1e-12);
                INFO(x.shape() << ": " << report.message);
                CHECK(report.passed);
                for (std::size_t i = 0; i < inputs.size(); ++i) {
                    report = check_close(of_fused[i].value(), of_composed[i].value(), 1e-11);
                    INFO("gradient of input " << i << ": " << report.message);
                    CHECK(report.passed);
                }
            }
        }
    }
}

}  // namespace linalg_size_tests
