#include "fit/fitter.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>

#include "core/error.h"
#include "core/interrupt.h"
#include "core/tensor_eigen.h"
#include "fit/fit_problem.h"
#include "nn/optim/adam.h"
#include "nn/optim/lbfgs.h"

namespace stymo {

namespace {

void report_step(const FitProblem& problem, const FitOptions& options, const FitResult& result) {
    if (options.on_step)
        options.on_step(
            {std::ssize(result.losses), result.losses.back(), detached(problem.codes())});
}

void fit_by_adam(FitProblem& problem, const FitOptions& options, double learning_rate,
                 FitResult& result) {
    Adam adam;
    for (std::int64_t step = 0; step < options.steps && !interrupted(); ++step) {
        const bool other_images = problem.choose_images(step);
        if (other_images || step % options.selection_interval == 0)
            static_cast<void>(problem.select_samples());
        problem.choose_side(step);
        FitProblem::Evaluation evaluation = problem.evaluate();
        if (!std::isfinite(evaluation.loss))
            fail<NumericError>("fitting step ", step,
                               ": the loss is not finite; lower the learning rate");
        result.losses.push_back(evaluation.loss);
        result.terms = std::move(evaluation.terms);
        const std::span gradients(evaluation.gradients);
        adam.step(problem.offsets(), gradients.first(problem.offsets().size()), learning_rate);
        adam.step(problem.orbits(), gradients.subspan(problem.offsets().size()),
                  learning_rate * options.pose_learning_rate_factor);
        learning_rate *= options.decay;
        report_step(problem, options, result);
    }
}

/// The parameters of a problem as one vector. Poses are scaled so that L-BFGS moves them as little
/// as Adam does with their smaller learning rate.
class ParameterVector {
public:
    ParameterVector(const FitProblem& problem, double pose_unit)
        : problem_(problem), pose_unit_(pose_unit) {}

    [[nodiscard]] Eigen::VectorXd values() const {
        return joined(variables_of(problem_.offsets()), variables_of(problem_.orbits()),
                      1.0 / pose_unit_);
    }
    [[nodiscard]] Eigen::VectorXd gradient(const std::vector<Variable>& gradients) const {
        const auto first_orbit = gradients.begin() + std::ssize(problem_.offsets());
        return joined({gradients.begin(), first_orbit}, {first_orbit, gradients.end()}, pose_unit_);
    }
    void set(const Eigen::VectorXd& numbers) const {
        Eigen::Index begin = 0;
        for (const Parameter& offset : problem_.offsets()) set(offset, numbers, begin, 1.0);
        for (const Parameter& orbit : problem_.orbits()) set(orbit, numbers, begin, pose_unit_);
    }

private:
    static Eigen::VectorXd joined(const std::vector<Variable>& offsets,
                                  const std::vector<Variable>& orbits, double factor) {
        std::vector<double> numbers;
        for (const Variable& offset : offsets)
            std::ranges::copy(offset.value().to_vector(), std::back_inserter(numbers));
        for (const Variable& orbit : orbits)
            for (const double number : orbit.value().to_vector())
                numbers.push_back(factor * number);
        return Eigen::Map<const Eigen::VectorXd>(numbers.data(), std::ssize(numbers));
    }
    static void set(const Parameter& parameter, const Eigen::VectorXd& numbers, Eigen::Index& begin,
                    double factor) {
        const Tensor& value = parameter.variable().value();
        const Tensor own = tensor_from(factor * numbers.segment(begin, value.size()));
        parameter.set_value(own.reshaped(value.shape()).to(value.dtype()));
        begin += value.size();
    }

    const FitProblem& problem_;
    double pose_unit_;
};

void fit_by_lbfgs(FitProblem& problem, const FitOptions& options, double learning_rate,
                  FitResult& result) {
    const ParameterVector numbers(problem, options.pose_learning_rate_factor);
    const auto batch = static_cast<double>(problem.initial().batch());
    Eigen::VectorXd start = numbers.values();
    // The length of Adam's first step.
    const double first_step = learning_rate * std::sqrt(static_cast<double>(start.size()));
    Lbfgs minimiser(std::move(start), {.first_step = first_step});
    std::int64_t steps = 0;
    const auto objective = [&](const Eigen::VectorXd& point) {
        numbers.set(point);
        FitProblem::Evaluation evaluation = problem.evaluate();
        if (++steps == 1) result.losses.push_back(evaluation.loss);
        result.terms = std::move(evaluation.terms);
        return ValueAndGradient{evaluation.loss * batch, numbers.gradient(evaluation.gradients)};
    };
    std::int64_t schedule_step = 0;  // chooses the images
    for (std::int64_t iteration = 0; steps < options.steps && !interrupted(); ++iteration) {
        schedule_step = std::max(schedule_step, steps);
        const bool other_images = problem.choose_images(schedule_step);
        const bool select = other_images || iteration % options.selection_interval == 0;
        const bool other_samples = select && problem.select_samples();
        if (other_images || other_samples) minimiser.objective_changed();
        const bool moved = minimiser.step(objective, static_cast<int>(options.steps - steps));
        numbers.set(minimiser.point());
        result.losses.resize(static_cast<std::size_t>(steps), minimiser.current()->value / batch);
        report_step(problem, options, result);
        if (moved || steps == options.steps) continue;
        result.converged = schedule_step >= options.coarse_steps;
        if (result.converged) break;
        schedule_step = options.coarse_steps;
    }
}

}  // namespace

FitResult fit_codes(const Model& model, const ReconstructionLoss& loss, const FaceBatch& faces,
                    const FitOptions& options) {
    FitProblem problem(model, loss, faces, options);
    FitResult result;
    result.initial = problem.initial();
    const double learning_rate = options.learning_rate > 0.0
                                     ? options.learning_rate
                                     : model.config().reconstruction.fit_learning_rate;
    const bool ends = options.end_losses && options.steps > 0;
    if (ends) result.initial_loss = problem.complete_loss();
    switch (options.optimizer) {
        case FitOptimizer::adam: fit_by_adam(problem, options, learning_rate, result); break;
        case FitOptimizer::lbfgs: fit_by_lbfgs(problem, options, learning_rate, result); break;
    }
    if (ends) result.final_loss = problem.complete_loss();
    result.cameras = problem.cameras();
    result.fitted = detached(problem.codes());
    return result;
}

}  // namespace stymo
