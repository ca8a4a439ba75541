#include "support/check_grad.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/rng.h"

namespace stymo::test {
namespace {

constexpr std::int64_t small_input = 12;

/// A function of several inputs with several outputs, and which of the inputs are varied.
struct Problem {
    std::function<std::vector<Variable>(const std::vector<Variable>&)> function;
    std::vector<Tensor> inputs;
    std::vector<std::string> labels;
    std::vector<std::size_t> varied;
};

std::vector<Variable> as_leaves(const std::vector<Tensor>& inputs) {
    std::vector<Variable> leaves;
    for (const Tensor& input : inputs) leaves.push_back(Variable::leaf(input));
    return leaves;
}

std::vector<Variable> pick(const std::vector<Variable>& all,
                           const std::vector<std::size_t>& which) {
    std::vector<Variable> picked;
    for (const std::size_t i : which) picked.push_back(all[i]);
    return picked;
}

Variable contract(const std::vector<Variable>& values, std::span<const Variable> cotangents) {
    Variable total;
    for (std::size_t k = 0; k < values.size(); ++k) {
        const Variable term = sum(multiply(values[k], cotangents[k]));
        total = k == 0 ? term : add(total, term);
    }
    return total;
}

double dot(const Tensor& a, const Tensor& b) {
    const auto x = a.values<double>();
    const auto y = b.values<double>();
    double total = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) total += x[i] * y[i];
    return total;
}

double contracted_value(const Problem& problem, const std::vector<Tensor>& inputs,
                        const std::vector<Tensor>& cotangents) {
    const std::vector<Variable> values = problem.function(as_leaves(inputs));
    double total = 0.0;
    for (std::size_t k = 0; k < values.size(); ++k) total += dot(values[k].value(), cotangents[k]);
    return total;
}

/// Derivative along `direction` of input `which`.
double numeric_derivative(const Problem& problem, const std::vector<Tensor>& cotangents,
                          std::size_t which, const Tensor& direction, double step) {
    const auto value_at = [&](double offset) {
        std::vector<Tensor> inputs = problem.inputs;
        const auto moved = inputs[which].mutable_values<double>();
        for (std::size_t j = 0; j < moved.size(); ++j)
            moved[j] += offset * direction.values<double>()[j];
        return contracted_value(problem, inputs, cotangents);
    };
    const double near = value_at(step) - value_at(-step);
    const double far = value_at(2.0 * step) - value_at(-2.0 * step);
    return (8.0 * near - far) / (12.0 * step);
}

double relative_error(double exact, double numeric) {
    constexpr double floor = 1e-4;
    return std::abs(exact - numeric) / std::max({std::abs(exact), std::abs(numeric), floor});
}

/// Every element's derivative, for inputs small enough to read.
void write_table(std::ostream& stream, const Problem& problem,
                 const std::vector<Tensor>& cotangents, std::size_t which, const Tensor& exact,
                 double step) {
    for (std::int64_t j = 0; j < exact.size(); ++j) {
        Tensor direction = Tensor::zeros(exact.shape(), DType::float64);
        direction.mutable_values<double>()[static_cast<std::size_t>(j)] = 1.0;
        const double numeric = numeric_derivative(problem, cotangents, which, direction, step);
        const double analytic = exact.values<double>()[static_cast<std::size_t>(j)];
        stream << "\n    element " << j << ": exact " << analytic << ", numeric " << numeric
               << (relative_error(analytic, numeric) > 1e-6 ? "  <-" : "");
    }
}

/// The gradient of `problem`, contracted with cotangents that become inputs themselves.
Problem gradient_of(const Problem& problem, const std::vector<Tensor>& cotangents) {
    Problem gradient;
    const std::size_t count = problem.inputs.size();
    gradient.inputs = problem.inputs;
    gradient.labels = problem.labels;
    gradient.varied = problem.varied;
    for (std::size_t k = 0; k < cotangents.size(); ++k) {
        gradient.varied.push_back(gradient.inputs.size());
        gradient.inputs.push_back(cotangents[k]);
        gradient.labels.push_back("cotangent " + std::to_string(k));
    }
    gradient.function = [problem, count](const std::vector<Variable>& all) {
        const std::vector<Variable> inputs(all.begin(),
                                           all.begin() + static_cast<std::ptrdiff_t>(count));
        const Variable total = contract(problem.function(inputs), std::span(all).subspan(count));
        return grad(total, pick(inputs, problem.varied), {.create_graph = true, .dL_dy = {}});
    };
    return gradient;
}

void check_order(const std::string& name, const Problem& problem, int order,
                 const CheckGradOptions& options, Rng& rng, GradReport& report) {
    const std::vector<Variable> leaves = as_leaves(problem.inputs);
    const std::vector<Variable> values = problem.function(leaves);
    std::vector<Tensor> cotangents;
    std::vector<Variable> constants;
    for (const Variable& value : values) {
        cotangents.push_back(rng.uniform(value.shape(), -1.0, 1.0, DType::float64));
        constants.emplace_back(cotangents.back());
    }
    const std::vector<Variable> gradients =
        grad(contract(values, constants), pick(leaves, problem.varied));
    std::ostringstream message;
    message.precision(12);
    for (std::size_t i = 0; i < problem.varied.size(); ++i) {
        const std::size_t which = problem.varied[i];
        const Tensor direction =
            rng.uniform(problem.inputs[which].shape(), -1.0, 1.0, DType::float64);
        const Tensor& gradient = gradients[i].value();
        const double exact = dot(gradient, direction);
        const double numeric =
            numeric_derivative(problem, cotangents, which, direction, options.step);
        const double error = relative_error(exact, numeric);
        report.worst_error = std::max(report.worst_error, error);
        if (error <= options.tolerance) continue;
        report.passed = false;
        message << '[' << name << "] order " << order << ", " << problem.labels[which] << ' '
                << gradient.shape() << ", seed " << options.seed << ": exact " << exact
                << ", numeric " << numeric << ", relative error " << error << ", allowed "
                << options.tolerance;
        if (gradient.size() <= small_input)
            write_table(message, problem, cotangents, which, gradient, options.step);
        message << '\n';
    }
    report.message += message.str();
    if (report.passed && order < options.order) {
        check_order(name, gradient_of(problem, cotangents), order + 1, options, rng, report);
    }
}

}  // namespace

GradReport check_grad(const std::string& name, const GradFunction& function,
                      const std::vector<Tensor>& inputs, const CheckGradOptions& options) {
    Problem problem;
    problem.inputs = inputs;
    problem.function = [function](const std::vector<Variable>& variables) {
        return std::vector<Variable>{function(variables)};
    };
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        if (inputs[i].dtype() != DType::float64)
            fail<TypeError>("[check_grad] input ", i, " of ", name, " must be float64");
        problem.labels.push_back("input " + std::to_string(i));
        if (std::ranges::find(options.constants, i) == options.constants.end())
            problem.varied.push_back(i);
    }
    GradReport report;
    Rng rng(options.seed);
    check_order(name, problem, 1, options, rng, report);
    return report;
}

}  // namespace stymo::test
