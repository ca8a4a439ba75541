#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "core/error.h"

namespace stymo {

/// What a case computes in one element type. Numbers of very different magnitude belong into
/// tensors of their own.
struct StabilityResult {
    std::vector<Tensor> values;
    std::vector<Tensor> gradients{};  ///< empty: the case has none
};

/// One stiff or extreme case, run by the same code in float32 and in float64 on inputs that float32
/// holds exactly. The tests check every case and print it with Catch's option -s.
struct StabilityCase {
    std::string name;
    std::string behaviour;  ///< what the code does about it
    /// Largest |x32 - x64| / |x64| of any tensor, in the Euclidean norm. What is smaller than
    /// float32's least normal number does not count.
    double value_bound = 0.0;
    double gradient_bound = 0.0;
    std::function<StabilityResult(DType)> run;

    /// A case that must be refused: whether the error is of the right type, and what its message
    /// must name.
    std::function<bool(const Error&)> is_right_error{};
    std::string named{};
    bool infinite = false;  ///< the value is infinite by definition
};

/// What became of a case.
struct StabilityOutcome {
    bool value_finite = true;  ///< in both types
    bool gradient_finite = true;
    std::optional<double> value_error{};  ///< nothing for a case without numbers to compare
    std::optional<double> gradient_error{};
    std::string refusal{};  ///< what the error says, if one was thrown
    std::string failure{};  ///< one line on what is not as the row says; empty if all is
};

[[nodiscard]] StabilityOutcome run_stability_case(const StabilityCase& row);

/// What the rows are made of.
namespace stability {

using Function = std::function<std::vector<Variable>(const std::vector<Variable>&)>;

/// Values of `function` at `inputs` (float32, converted), and the gradient of their sum under fixed
/// random factors, up to `order`: 2 adds the gradient of that gradient, contracted in the same way.
[[nodiscard]] StabilityResult differentiate(DType dtype, const std::vector<Tensor>& inputs,
                                            const Function& function, int order = 1);

/// A row whose numbers come from `differentiate`.
[[nodiscard]] StabilityCase row(std::string name, std::string behaviour, double value_bound,
                                double gradient_bound, std::vector<Tensor> inputs,
                                Function function, int order = 1);
/// The rows of several lists.
[[nodiscard]] std::vector<StabilityCase> joined(
    std::initializer_list<std::vector<StabilityCase>> lists);

/// A row that must end with `ErrorType` whose message holds `named`.
template <class ErrorType>
[[nodiscard]] StabilityCase refused(std::string name, std::string behaviour, std::string named,
                                    std::function<StabilityResult(DType)> run) {
    StabilityCase result{
        .name = std::move(name), .behaviour = std::move(behaviour), .run = std::move(run)};
    result.is_right_error = [](const Error& error) {
        return dynamic_cast<const ErrorType*>(&error) != nullptr;
    };
    result.named = std::move(named);
    return result;
}

/// One tensor of one element for each number.
[[nodiscard]] std::vector<Tensor> scalars(const std::vector<double>& values);
/// Each input by itself.
[[nodiscard]] Function each(std::function<Variable(const Variable&)> function);

// The cases by what they test, each run by the tests of that folder.
[[nodiscard]] std::vector<StabilityCase> activation_cases();  // core
[[nodiscard]] std::vector<StabilityCase> ray_cases();         // render
[[nodiscard]] std::vector<StabilityCase> camera_cases();      // render
[[nodiscard]] std::vector<StabilityCase> layer_cases();       // nn
[[nodiscard]] std::vector<StabilityCase> loss_cases();        // nn
[[nodiscard]] std::vector<StabilityCase> product_cases();     // core
[[nodiscard]] std::vector<StabilityCase> renderer_cases();    // nn
[[nodiscard]] std::vector<StabilityCase> training_cases();    // train
[[nodiscard]] std::vector<StabilityCase> fitting_cases();     // fit

}  // namespace stability

}  // namespace stymo
