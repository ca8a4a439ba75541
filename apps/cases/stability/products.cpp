#include "apps/cases/stability/case.h"
#include "core/kernels/gemm.h"
#include "core/ops/ops.h"
#include "core/rng.h"

namespace stymo::stability {

namespace {

/// A convolution for which float32 uses Winograd's form, and its gradients, of images and weights
/// of these magnitudes.
StabilityCase convolution(const std::string& name, const std::string& behaviour, double image,
                          double weight) {
    const Tensor x = Rng(23).normal({1, 34, 34, 16}, 0.0, image),
                 w = Rng(24).normal({16, 3, 3, 16}, 0.0, weight);
    return row(name, behaviour, 1e-5, 1e-5, {x, w}, [](const std::vector<Variable>& inputs) {
        return std::vector<Variable>{conv2d(inputs[0], inputs[1], {.padding = 1})};
    });
}

/// The two BFloat16 parts of each number, of which its upper part alone is rounded.
std::array<Variable, 2> parts_of(const Tensor& x) {
    Tensor upper(x.shape()), lower(x.shape());
    const std::span<const float> from = x.values<float>();
    const std::span<float> high = upper.mutable_values<float>(),
                           low = lower.mutable_values<float>();
    for (std::size_t i = 0; i < from.size(); ++i) {
        high[i] = kernels::widened(kernels::rounded_to_bfloat16(from[i]));
        low[i] = kernels::widened(kernels::rounded_to_bfloat16(from[i] - high[i]));
    }
    return {Variable(upper), Variable(lower)};
}

/// The three products that `--precision high` sums on matrix tiles (core/kernels/tile_product.h),
/// on any processor.
Variable split_product(const Tensor& a, const Tensor& b) {
    const auto [upper_a, lower_a] = parts_of(a);
    const auto [upper_b, lower_b] = parts_of(b);
    return matmul(upper_a, upper_b) + matmul(upper_a, lower_b) + matmul(lower_a, upper_b);
}

/// A product whose summands cancel to a small part of their magnitude. The sum of the magnitudes
/// stands beside it, because the error is relative to that.
StabilityCase split(const std::string& name, double magnitude) {
    Tensor a = Rng(25).normal({1, 8, 512}, 0.0, magnitude);
    const Tensor b = Rng(26).normal({1, 256, 8}, 0.0, 1.0);
    // The second half of the inner elements repeats the first with the other sign, almost.
    const std::span<float> values = a.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        if (i % 512 >= 256) values[i] = -values[i - 256] * 1.0001F;
    const Tensor twice = concat({Variable(b), Variable(b)}, 1).value();
    return {
        .name = name,
        .behaviour = "products of two 16-bit parts each, error 2^-15 of the magnitudes",
        .value_bound = 0x1p-15,
        .run = [=](DType dtype) {
            const Tensor right = twice.to(dtype), left = a.to(dtype);
            const Variable product = dtype == DType::float32
                                         ? split_product(left, right)
                                         : matmul(Variable(left), Variable(right));
            return StabilityResult{
                .values = {concat({product, matmul(abs(Variable(left)), abs(Variable(right)))}, 1)
                               .value()}};
        }};
}

}  // namespace

std::vector<StabilityCase> product_cases() {
    const std::string behaviour = "Winograd's form, whose transforms stay within float32's range";
    return {
        convolution("convolution of images of 1e18", behaviour, 1e18, 1.0),
        convolution("convolution of images of 1e-18", behaviour, 1e-18, 1.0),
        convolution("convolution of images of 1e18 with weights of 1e-18", behaviour, 1e18, 1e-18),
        split("a product in two parts that cancels", 1.0),
        split("a product in two parts that cancels, numbers of 1e30", 1e30),
        split("a product in two parts that cancels, numbers of 1e-30", 1e-30)};
}

}  // namespace stymo::stability
