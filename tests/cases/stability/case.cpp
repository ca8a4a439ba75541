#include "cases/stability/case.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/rng.h"

namespace stymo {

namespace {

bool all_finite(const std::vector<Tensor>& tensors) {
    return std::ranges::all_of(tensors, &Tensor::all_finite);
}

double relative_error(const Tensor& single, const Tensor& reference) {
    const std::vector<double> x = single.to_vector(), y = reference.to_vector();
    if (x.size() != y.size()) return std::numeric_limits<double>::infinity();
    // Largest magnitudes taken out, so that no square leaves float64's range.
    double largest = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i)
        largest = std::max({largest, std::abs(y[i]), std::abs(x[i])});
    constexpr double least = std::numeric_limits<float>::min();
    if (largest <= least) return 0.0;
    double difference = 0.0, norm = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) {
        difference += std::pow(std::max(0.0, std::abs(x[i] - y[i]) - least) / largest, 2.0);
        norm += std::pow(y[i] / largest, 2.0);
    }
    return difference == 0.0 ? 0.0 : std::sqrt(difference / norm);
}

std::optional<double> worst_error(const std::vector<Tensor>& single,
                                  const std::vector<Tensor>& reference) {
    if (reference.empty()) return std::nullopt;
    double worst =
        single.size() == reference.size() ? 0.0 : std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < std::min(single.size(), reference.size()); ++i) {
        const double error = relative_error(single[i], reference[i]);
        // Written so that NaN is the worst of all.
        if (!(error <= worst)) worst = error;
    }
    return worst;
}

std::string beyond(const char* what, const std::optional<double>& error, double bound) {
    if (!error || *error <= bound) return {};
    std::ostringstream text;
    text << what << ": relative error " << *error << " is above the bound " << bound << "; ";
    return text.str();
}

StabilityOutcome refused_outcome(const StabilityCase& row, const Error& error) {
    StabilityOutcome outcome{.refusal = error.what()};
    if (!row.is_right_error) {
        outcome.failure = "refused: " + outcome.refusal;
    } else if (!row.is_right_error(error)) {
        outcome.failure = "refused with another type of error: " + outcome.refusal;
    } else if (outcome.refusal.find(row.named) == std::string::npos) {
        outcome.failure = "the error does not name " + row.named + ": " + outcome.refusal;
    }
    return outcome;
}

}  // namespace

StabilityOutcome run_stability_case(const StabilityCase& row) {
    std::vector<StabilityResult> results;
    StabilityOutcome outcome;
    int refusals = 0;
    for (const DType dtype : {DType::float32, DType::float64}) {
        try {
            results.push_back(row.run(dtype));
        } catch (const Error& error) {
            outcome = refused_outcome(row, error);
            ++refusals;
        }
    }
    if (refusals == 1) outcome.failure += "refused in one of the two types only; ";
    if (refusals > 0) return outcome;
    for (const StabilityResult& result : results) {
        outcome.value_finite = outcome.value_finite && all_finite(result.values);
        outcome.gradient_finite = outcome.gradient_finite && all_finite(result.gradients);
    }
    if (row.is_right_error) outcome.failure = "not refused; ";
    if (outcome.value_finite == row.infinite)
        outcome.failure += row.infinite ? "the value is finite; " : "the value is not finite; ";
    if (!outcome.gradient_finite) outcome.failure += "the gradient is not finite; ";
    if (outcome.value_finite)
        outcome.value_error = worst_error(results[0].values, results[1].values);
    if (outcome.gradient_finite)
        outcome.gradient_error = worst_error(results[0].gradients, results[1].gradients);
    outcome.failure += beyond("value", outcome.value_error, row.value_bound);
    outcome.failure += beyond("gradient", outcome.gradient_error, row.gradient_bound);
    return outcome;
}

namespace stability {

namespace {

/// The sum of all elements under factors in [0.5, 1.5), the same ones in both types.
Variable contracted(const std::vector<Variable>& values, Rng draws) {
    Variable total;
    for (const Variable& value : values) {
        const Tensor factors = draws.uniform(value.shape(), 0.5, 1.5).to(value.dtype());
        const Variable term = sum(value * Variable(factors));
        total = total.defined() ? total + term : term;
    }
    return total;
}

}  // namespace

StabilityResult differentiate(DType dtype, const std::vector<Tensor>& inputs,
                              const Function& function, int order) {
    std::vector<Variable> leaves;
    for (const Tensor& input : inputs) leaves.push_back(Variable::leaf(input.to(dtype)));
    std::vector<Variable> derivatives = function(leaves);
    StabilityResult result;
    for (const Variable& value : derivatives) result.values.push_back(value.value());
    const Rng draws(20);
    for (int k = 1; k <= order; ++k) {
        const Variable scalar = contracted(derivatives, draws.split(static_cast<std::uint64_t>(k)));
        derivatives = grad(scalar, leaves, {.create_graph = k < order, .dL_dy = {}});
        for (const Variable& gradient : derivatives) result.gradients.push_back(gradient.value());
    }
    return result;
}

StabilityCase row(std::string name, std::string behaviour, double value_bound,
                  double gradient_bound, std::vector<Tensor> inputs, Function function, int order) {
    return {.name = std::move(name),
            .behaviour = std::move(behaviour),
            .value_bound = value_bound,
            .gradient_bound = gradient_bound,
            .run = [inputs = std::move(inputs), function = std::move(function),
                    order](DType dtype) { return differentiate(dtype, inputs, function, order); }};
}

std::vector<StabilityCase> joined(std::initializer_list<std::vector<StabilityCase>> lists) {
    std::vector<StabilityCase> all;
    for (const std::vector<StabilityCase>& list : lists)
        all.insert(all.end(), list.begin(), list.end());
    return all;
}

std::vector<Tensor> scalars(const std::vector<double>& values) {
    std::vector<Tensor> result;
    for (const double value : values) result.push_back(Tensor::full({1}, value));
    return result;
}

Function each(std::function<Variable(const Variable&)> function) {
    return [function = std::move(function)](const std::vector<Variable>& inputs) {
        std::vector<Variable> values;
        for (const Variable& input : inputs) values.push_back(function(input));
        return values;
    };
}

}  // namespace stability

}  // namespace stymo
