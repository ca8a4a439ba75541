#include "cases/stability/case.h"
#include "core/kernels/gemm.h"
#include "core/matmul_precision.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "render/encoding.h"

namespace stymo::stability {

namespace {

std::vector<StabilityCase> sine_cases() {
    std::vector<StabilityCase> rows;
    const auto both = each([](const Variable& x) { return concat({sin(x), cos(x)}, 0); });
    rows.push_back(row("sine and cosine of arguments up to 8192",
                       "vectorised, three-part reduction", 2e-7, 2e-7,
                       {Rng(1).uniform({512}, -8192.0, 8192.0)}, both));
    rows.push_back(row("sine and cosine of arguments up to 1e7",
                       "the library's exact reduction beyond 8192", 2e-7, 2e-7,
                       {Rng(2).uniform({512}, -1e7, 1e7)}, both));
    // Powers of two, whose products and sums float32 holds exactly: what is left is the sine's own
    // error.
    rows.push_back(row(
        "sine layer whose arguments reach 1e7",
        "each vector of arguments beyond 8192 goes to the library", 2e-6, 2e-6,
        {Tensor::full({1, 8, 4}, 2097152.0), Tensor::full({1, 4, 4}, 1.0), Tensor::full({4}, 1.0)},
        [](const std::vector<Variable>& x) {
            return std::vector<Variable>{linear(x[0], x[1], x[2], Activation::sine)};
        }));
    rows.push_back(row("encoding of points at 1e4, 10 frequencies",
                       "arguments up to 5e6 are exact, powers of two times the point", 2e-7, 1e-6,
                       {Rng(3).uniform({1, 64, 3}, -1e4, 1e4)}, [](const std::vector<Variable>& x) {
                           return std::vector<Variable>{positional_encoding(x[0], 10)};
                       }));
    return rows;
}

std::vector<StabilityCase> exponential_cases() {
    const std::vector<Tensor> extreme =
        scalars({-1e4, -100.0, -20.0, -5.0, 0.0, 5.0, 20.0, 100.0, 1e4});
    std::vector<StabilityCase> rows;
    const auto add = [&](const std::string& name, const std::string& behaviour, double bound,
                         std::function<Variable(const Variable&)> function) {
        rows.push_back(row(name, behaviour, bound, bound, extreme, each(std::move(function)), 2));
    };
    add("softplus, log(1 + exp(x)), +-1e4, two derivatives", "max(x, 0) + log1p(exp(-|x|))", 1e-6,
        [](const Variable& x) { return softplus(x); });
    add("sigmoid, +-1e4, two derivatives",
        "exponential of -|x| only; derivative y sigmoid(-x), not y (1 - y)", 1e-6,
        [](const Variable& x) { return sigmoid(x); });
    add("tanh, +-1e4, two derivatives", "derivative 4 sigmoid(2x) sigmoid(-2x), not 1 - y^2", 1e-6,
        [](const Variable& x) { return tanh(x); });
    for (const double target : {0.0, 1.0}) {
        const std::string name = target == 0.0 ? "cross-entropy of logits +-1e4, target 0"
                                               : "cross-entropy of logits +-1e4, target 1";
        add(name, "(1 - t) softplus(x) + t softplus(-x): no difference of large numbers", 1e-6,
            [target](const Variable& x) {
                return binary_cross_entropy_with_logits(x,
                                                        Tensor::full(x.shape(), target, x.dtype()));
            });
    }
    return rows;
}

}  // namespace

std::vector<StabilityCase> activation_cases() {
    return joined({sine_cases(), exponential_cases()});
}

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

/// The product as `--precision medium` computes it where the processor has no instructions for it.
Variable rounded_product(const Tensor& a, const Tensor& b) {
    const PrecisionScope scope(MatmulPrecision::medium, true);
    return matmul(Variable(a), Variable(b));
}

using Product = Variable (*)(const Tensor&, const Tensor&);

/// A product whose summands cancel to a small part of their magnitude. The sum of the magnitudes
/// stands beside it, because the error is relative to that.
StabilityCase cancelling(const std::string& numbers, double magnitude, Product multiply) {
    const bool in_parts = multiply == split_product;
    Tensor a = Rng(25).normal({1, 8, 512}, 0.0, magnitude);
    const Tensor b = Rng(26).normal({1, 256, 8}, 0.0, 1.0);
    // The second half of the inner elements repeats the first with the other sign, almost.
    const std::span<float> values = a.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        if (i % 512 >= 256) values[i] = -values[i - 256] * 1.0001F;
    const Tensor twice = concat({Variable(b), Variable(b)}, 1).value();
    return {
        .name = std::string(in_parts ? "a product in two parts" : "a product in bfloat16") +
                " that cancels" + numbers,
        .behaviour = in_parts ? "products of two 16-bit parts each, error 2^-15 of the magnitudes"
                              : "operands of 16 bits, error 2^-7 of the magnitudes",
        .value_bound = in_parts ? 0x1p-15 : 0x1p-7,
        .run = [=](DType dtype) {
            const Tensor right = twice.to(dtype), left = a.to(dtype);
            const Variable product = dtype == DType::float32
                                         ? multiply(left, right)
                                         : matmul(Variable(left), Variable(right));
            return StabilityResult{
                .values = {concat({product, matmul(abs(Variable(left)), abs(Variable(right)))}, 1)
                               .value()}};
        }};
}

}  // namespace

std::vector<StabilityCase> product_cases() {
    const std::string behaviour = "Winograd's form, whose transforms stay within float32's range";
    std::vector<StabilityCase> cases{
        convolution("convolution of images of 1e18", behaviour, 1e18, 1.0),
        convolution("convolution of images of 1e-18", behaviour, 1e-18, 1.0),
        convolution("convolution of images of 1e18 with weights of 1e-18", behaviour, 1e18, 1e-18)};
    for (const Product multiply : {split_product, rounded_product}) {
        cases.push_back(cancelling("", 1.0, multiply));
        cases.push_back(cancelling(", numbers of 1e30", 1e30, multiply));
        cases.push_back(cancelling(", numbers of 1e-30", 1e-30, multiply));
    }
    return cases;
}

}  // namespace stymo::stability
