#include "apps/cases/stability/case.h"
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
    add("log sigmoid, +-1e4, two derivatives", "-softplus(-x)", 1e-6,
        [](const Variable& x) { return log_sigmoid(x); });
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
    const Tensor spread = Tensor::from({1, 4}, std::vector<float>{-1e4F, 0.0F, 5.0F, 1e4F});
    rows.push_back(row("log of a sum of exponentials, +-1e4", "largest element taken out", 1e-6,
                       1e-6, {spread}, each([](const Variable& x) { return log_sum_exp(x, 1); })));
    rows.push_back(row("softmax, +-1e4", "through the logarithm", 1e-6, 1e-6, {spread},
                       each([](const Variable& x) { return softmax(x, 1); })));
    return rows;
}

}  // namespace

std::vector<StabilityCase> activation_cases() {
    return joined({sine_cases(), exponential_cases()});
}

}  // namespace stymo::stability
