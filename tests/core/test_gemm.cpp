#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "core/kernels/gemm.h"
#include "core/rng.h"
#include "core/tensor.h"

using namespace stymo;
using namespace stymo::kernels;

namespace {

std::vector<double> draw(Rng& rng, std::int64_t count, double limit = 1.0) {
    const Tensor values = rng.uniform({count}, -limit, limit, DType::float64);
    return {values.values<double>().begin(), values.values<double>().end()};
}

template <class T>
std::vector<T> converted(const std::vector<double>& values) {
    std::vector<T> result;
    for (const double value : values) result.push_back(static_cast<T>(value));
    return result;
}

struct Extents {
    std::int64_t m, k, n;
};

enum class Start { zero, bias, present_values };

struct Product {
    Extents extents;
    bool transpose_left;
    bool transpose_right;
    Start start;
    Activation activation;
    bool with_slope;
};

double activated(double x, Activation activation) {
    if (activation == Activation::sine) return std::sin(x);
    if (activation == Activation::leaky_relu) return std::sqrt(2.0) * (x > 0.0 ? x : 0.2 * x);
    return x;
}

double slope_of(double x, Activation activation) {
    if (activation == Activation::sine) return std::cos(x);
    if (activation == Activation::leaky_relu) return std::sqrt(2.0) * (x > 0.0 ? 1.0 : 0.2);
    return 1.0;
}

/// Errors of a product of rows `gap` further apart than they need be, which must leave the gaps
/// alone, against loops in float64. The tolerance is relative to the sum of absolute values.
template <class T>
void check(const Product& product, double tolerance) {
    const auto [m, k, n] = product.extents;
    constexpr std::int64_t gap = 3;
    const std::int64_t stride = n + gap;
    Rng rng(static_cast<std::uint64_t>(m * 10007 + k * 101 + n));
    const auto a = converted<T>(draw(rng, m * k));
    const auto b = converted<T>(draw(rng, k * n));
    const auto bias = converted<T>(draw(rng, n));
    const auto present = converted<T>(draw(rng, m * stride));
    const LeftMatrix<T> left =
        product.transpose_left ? LeftMatrix<T>{a.data(), 1, m} : LeftMatrix<T>{a.data(), k, 1};
    const PackedMatrix<T> right(b.data(), k, n, product.transpose_right ? 1 : n,
                                product.transpose_right ? k : 1);
    std::vector<T> c = present;
    std::vector<T> slope(product.with_slope ? static_cast<std::size_t>(m * stride) : 0, T(7));
    multiply_packed(c.data(), stride, left, m, right,
                    {.bias = product.start == Start::bias ? bias.data() : nullptr,
                     .present_values = product.start == Start::present_values,
                     .activation = product.activation,
                     .slope = product.with_slope ? slope.data() : nullptr});
    double worst = 0.0;
    bool gaps_kept = true;
    for (std::int64_t i = 0; i < m; ++i) {
        for (std::int64_t j = 0; j < stride; ++j) {
            const auto index = static_cast<std::size_t>(i * stride + j);
            if (j >= n) {
                gaps_kept &=
                    c[index] == present[index] && (!product.with_slope || slope[index] == T(7));
                continue;
            }
            double sum = 0.0;
            if (product.start == Start::bias) sum = bias[static_cast<std::size_t>(j)];
            if (product.start == Start::present_values) sum = present[index];
            double size = 1.0;
            for (std::int64_t p = 0; p < k; ++p) {
                const double factor =
                    a[static_cast<std::size_t>(product.transpose_left ? p * m + i : i * k + p)];
                const double other =
                    b[static_cast<std::size_t>(product.transpose_right ? j * k + p : p * n + j)];
                sum += factor * other;
                size += std::abs(factor * other);
            }
            // The kink of the leaky ReLU: a rounded sum may lie on its other side.
            if (product.activation == Activation::leaky_relu && std::abs(sum) < tolerance * size)
                continue;
            const double value = activated(sum, product.activation);
            worst = std::max(worst, std::abs(c[index] - value) / size);
            if (product.with_slope)
                worst = std::max(worst,
                                 std::abs(slope[index] - slope_of(sum, product.activation)) / size);
        }
    }
    INFO(m << " x " << k << " x " << n << (product.transpose_left ? ", left transposed" : "")
           << (product.transpose_right ? ", right transposed" : "") << ", start "
           << static_cast<int>(product.start) << ", activation "
           << static_cast<int>(product.activation) << (product.with_slope ? ", slope" : ""));
    CHECK(worst <= tolerance);
    CHECK(gaps_kept);
}

/// Every combination, for extents on both sides of those of blocks, panels and pieces.
template <class T>
void check_all(double tolerance) {
    for (const Extents extents : {Extents{1, 1, 1}, Extents{13, 0, 5}, Extents{7, 3, 33},
                                  Extents{31, 64, 32}, Extents{24, 257, 48}, Extents{253, 65, 17},
                                  Extents{5, 600, 70}, Extents{12, 5, 1}, Extents{3, 1031, 3}}) {
        for (const Start start : {Start::zero, Start::bias, Start::present_values}) {
            for (const Activation activation :
                 {Activation::none, Activation::sine, Activation::leaky_relu}) {
                for (const bool with_slope : {false, true}) {
                    for (const bool transpose : {false, true})
                        check<T>({extents, transpose, transpose, start, activation, with_slope},
                                 tolerance);
                }
            }
        }
    }
}

}  // namespace

TEST_CASE("Packed products and their epilogues agree with plain loops", "[gemm]") {
    check_all<float>(5e-7);
    check_all<double>(1e-15);
}

TEST_CASE("Rounding to bfloat16 takes the nearest number, the even one of two", "[gemm]") {
    CHECK(widened(rounded_to_bfloat16(1.0F)) == 1.0F);
    CHECK(widened(rounded_to_bfloat16(1.0F + 0x1p-8F)) == 1.0F);
    CHECK(widened(rounded_to_bfloat16(1.0F + 0x3p-8F)) == 1.0F + 0x4p-8F);
    CHECK(widened(rounded_to_bfloat16(-1.0F - 0x1.1p-8F)) == -1.0F - 0x2p-8F);
    CHECK(std::isnan(widened(rounded_to_bfloat16(std::numeric_limits<float>::quiet_NaN()))));
    CHECK(std::isinf(widened(rounded_to_bfloat16(std::numeric_limits<float>::max()))));
}

namespace {

/// Sine and cosine as the epilogue computes them.
struct SineCosine {
    std::vector<float> sine, cosine;
};

SineCosine sine_cosine(const std::vector<float>& x) {
    const float one = 1.0F;
    const auto count = static_cast<std::int64_t>(x.size());
    SineCosine result{std::vector<float>(x.size()), std::vector<float>(x.size())};
    multiply_packed<float>(result.sine.data(), count, {&one, 1}, 1,
                           PackedMatrix<float>(x.data(), 1, count, count, 1),
                           {.activation = Activation::sine, .slope = result.cosine.data()});
    return result;
}

}  // namespace

TEST_CASE("The vector sine keeps float32 accuracy and large arguments go to the library",
          "[gemm]") {
    Rng rng(3);
    const double pi = std::acos(-1.0);
    for (const double limit : {1e-3, 1.6, 30.0, 8192.0, 1e6, 1e30}) {
        std::vector<float> x = converted<float>(draw(rng, 200000, limit));
        for (int i = -2600; i <= 2600; ++i) x.push_back(static_cast<float>(i * pi / 2));
        const SineCosine values = sine_cosine(x);
        double worst = 0.0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            worst = std::max(worst, std::abs(values.sine[i] - std::sin(static_cast<double>(x[i]))));
            worst =
                std::max(worst, std::abs(values.cosine[i] - std::cos(static_cast<double>(x[i]))));
        }
        INFO("|x| up to " << limit << ", error " << worst);
        CHECK(worst <= 3e-7);
    }
    const SineCosine special = sine_cosine(
        {0.5F, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()});
    CHECK(std::abs(special.sine[0] - std::sin(0.5F)) <= 3e-7F);
    CHECK(std::isnan(special.sine[1]));
    CHECK(std::isnan(special.sine[2]));
}
