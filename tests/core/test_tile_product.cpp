#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"
#include "core/kernels/gemm.h"
#include "core/kernels/tile_product.h"
#include "core/matmul_precision.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "core/rng.h"

namespace tile_product_tests {

using namespace stymo;
using namespace stymo::kernels;

namespace {

std::vector<float> draw(Rng& rng, std::int64_t count) {
    const Tensor values = rng.normal({count}, 0.0, 1.0);
    return {values.values<float>().begin(), values.values<float>().end()};
}

double largest_difference(const Tensor& a, const Tensor& b) {
    double largest = 0.0;
    for (std::int64_t i = 0; i < a.size(); ++i)
        largest = std::max(
            largest, std::abs(static_cast<double>(a.values<float>()[static_cast<std::size_t>(i)]) -
                              b.values<double>()[static_cast<std::size_t>(i)]));
    return largest;
}

}  // namespace

TEST_CASE("Operands are split into numbers of BFloat16", "[tiles]") {
    const auto [precision, error, emulated] =
        GENERATE(std::tuple{MatmulPrecision::high, 0x1p-15, false},
                 std::tuple{MatmulPrecision::medium, 0x1p-7, false},
                 std::tuple{MatmulPrecision::medium, 0x1p-7, true});
    const PrecisionScope lowered(precision, emulated);
    if (computed_precision(precision) == MatmulPrecision::highest) return;
    Rng rng(5);
    for (int i = 0; i < 200; ++i) {
        // A sum of one product, the other fifteen being zeros.
        std::vector<float> x(16), y(16);
        x[static_cast<std::size_t>(i % 16)] =
            draw(rng, 1).front() * std::exp2f(static_cast<float>(i / 2 - 50));
        y[static_cast<std::size_t>(i % 16)] = draw(rng, 1).front();
        float c = 0.0F;
        multiply_packed<float>(&c, 1, {x.data(), 16}, 1,
                               PackedMatrix<float>(y.data(), 16, 1, 1, 16));
        const double value = static_cast<double>(x[static_cast<std::size_t>(i % 16)]) *
                             y[static_cast<std::size_t>(i % 16)];
        CHECK(std::abs(c - value) <= error * std::abs(value));
        CHECK((c != value || value == 0.0));
    }
}

TEST_CASE("A part of a product on tiles has the bits of the whole", "[tiles]") {
    const PrecisionScope lowered(GENERATE(MatmulPrecision::high, MatmulPrecision::medium));
    Rng rng(7);
    const std::int64_t m = 75, k = 1100, n = 41;
    const std::vector<float> a = draw(rng, m * k), b = draw(rng, k * n);
    const PackedMatrix<float> right(b.data(), k, n, n, 1);
    std::vector<float> whole(static_cast<std::size_t>(m * n)), parts(whole.size());
    multiply_packed<float>(whole.data(), n, {a.data(), k}, m, right);
    for (std::int64_t row = 0, rows = 1; row < m; row += rows, rows = std::min(rows + 3, m - row))
        multiply_packed<float>(parts.data() + row * n, n, {a.data() + row * k, k}, rows, right);
    CHECK(whole == parts);
    // Packed as it stands, and from panels that are split by each product.
    const std::int64_t columns = 64;
    const std::vector<float> wide = draw(rng, k * columns);
    std::vector<float> packed(static_cast<std::size_t>(m * columns)), in_place(packed.size());
    multiply_packed<float>(packed.data(), columns, {a.data(), k}, m,
                           PackedMatrix<float>(wide.data(), k, columns, columns, 1));
    multiply_packed<float>(in_place.data(), columns, {a.data(), k}, m,
                           PackedMatrix<float>::in_place(wide.data(), k, columns, columns));
    CHECK(packed == in_place);
}

TEST_CASE("What is not finite stays so in a product on tiles", "[tiles]") {
    const PrecisionScope lowered(GENERATE(MatmulPrecision::high, MatmulPrecision::medium));
    const float infinity = std::numeric_limits<float>::infinity();
    for (const float special : {infinity, -infinity, std::numeric_limits<float>::quiet_NaN()}) {
        std::vector<float> a(40 * 33, 1.0F), c(40 * 20);
        const std::vector<float> b(33 * 20, 1.5F);
        a[17 * 33 + 32] = special;
        multiply_packed<float>(c.data(), 20, {a.data(), 33}, 40,
                               PackedMatrix<float>(b.data(), 33, 20, 20, 1));
        for (std::size_t i = 0; i < c.size(); ++i) CHECK(std::isfinite(c[i]) == (i / 20 != 17));
    }
}

TEST_CASE("Products, linear maps and convolutions on tiles agree with float64", "[tiles]") {
    const auto [precision, error, emulated] =
        GENERATE(std::tuple{MatmulPrecision::high, 4e-5, false},
                 std::tuple{MatmulPrecision::medium, 2e-2, false},
                 std::tuple{MatmulPrecision::medium, 2e-2, true});
    const PrecisionScope lowered(precision, emulated);
    Rng rng(11);
    const auto compare = [&, allowed = error](const std::vector<Shape>& shapes, auto op) {
        std::vector<Variable> x, x64;
        double size = 1.0;
        for (const Shape& shape : shapes) {
            const Tensor drawn = rng.normal(shape, 0.0, 1.0);
            x.push_back(Variable::leaf(drawn));
            x64.push_back(Variable::leaf(drawn.to(DType::float64)));
        }
        const Tensor exact = op(x64).value();
        for (const double value : exact.values<double>()) size = std::max(size, std::abs(value));
        for (const int threads : {1, 2}) {
            set_thread_count(threads);
            CHECK(largest_difference(op(x).value(), exact) <= allowed * size);
        }
        set_thread_count(0);
    };
    for (const bool transpose_a : {false, true}) {
        for (const bool transpose_b : {false, true}) {
            for (const std::int64_t m : {3, 70, 500})
                compare({transpose_a ? Shape{2, 90, m} : Shape{2, m, 90},
                         transpose_b ? Shape{2, 45, 90} : Shape{2, 90, 45}},
                        [&](const std::vector<Variable>& x) {
                            return matmul(x[0], x[1], {transpose_a, transpose_b});
                        });
        }
    }
    compare({{1, 20000, 24}, {1, 20000, 40}}, [](const std::vector<Variable>& x) {
        return matmul(x[0], x[1], {true, false});
    });
    for (const int stride : {1, 2})
        compare({{1, 40, 40, 32}, {48, 3, 3, 32}}, [&](const std::vector<Variable>& x) {
            return conv2d(x[0], x[1], {.stride = stride, .padding = 1});
        });
}

TEST_CASE("A product of medium precision is that of rounded operands", "[tiles]") {
    const PrecisionScope lowered(MatmulPrecision::medium, GENERATE(false, true));
    if (computed_precision(MatmulPrecision::medium) == MatmulPrecision::highest) return;
    // Blocks and panels that are whole and that are not, and operands that lie along both sides, as
    // in a layer, its gradients and a convolution.
    const auto sides = GENERATE(std::array{19, 70, 37}, std::array{64, 256, 64},
                                std::array{33, 1100, 16}, std::array{45, 27, 48});
    const int m = sides[0], k = sides[1], n = sides[2];
    const bool transposed_left = GENERATE(false, true), transposed_right = GENERATE(false, true);
    Rng rng(13);
    std::vector<float> a = draw(rng, m * k), b = draw(rng, k * n);
    const LeftMatrix<float> left =
        transposed_left ? LeftMatrix<float>{a.data(), 1, m} : LeftMatrix<float>{a.data(), k};
    const std::int64_t inner_stride = transposed_right ? 1 : n,
                       column_stride = transposed_right ? k : 1;
    std::vector<float> c(static_cast<std::size_t>(m * n)), of_rounded(c.size());
    const auto multiply = [&](std::vector<float>& to) {
        multiply_packed<float>(to.data(), n, left, m,
                               PackedMatrix<float>(b.data(), k, n, inner_stride, column_stride));
    };
    multiply(c);
    for (std::vector<float>* operand : {&a, &b})
        for (float& x : *operand) x = widened(rounded_to_bfloat16(x));
    multiply(of_rounded);
    CHECK(c == of_rounded);
    for (std::int64_t i = 0; i < m; ++i) {
        for (std::int64_t j = 0; j < n; ++j) {
            double sum = 0.0, size = 0.0;
            for (std::int64_t l = 0; l < k; ++l) {
                const double product =
                    static_cast<double>(left.data[i * left.row_stride + l * left.inner_stride]) *
                    b[static_cast<std::size_t>(l * inner_stride + j * column_stride)];
                sum += product;
                size += std::abs(product);
            }
            // Products of BFloat16 are exact in float32; each of k sums is rounded once.
            CHECK(std::abs(c[static_cast<std::size_t>(i * n + j)] - sum) <=
                  static_cast<double>(k) * 0x1p-24 * size);
        }
    }
}

TEST_CASE("Precisions of matrix products have names", "[tiles]") {
    for (const auto precision :
         {MatmulPrecision::highest, MatmulPrecision::high, MatmulPrecision::medium})
        CHECK(matmul_precision_of(name_of(precision)) == precision);
    CHECK_THROWS_AS(matmul_precision_of("low"), ValueError);
}

}  // namespace tile_product_tests
