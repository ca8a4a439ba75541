#include "apps/cases/stability/case.h"
#include "core/rng.h"
#include "core/tensor_eigen.h"
#include "fit/morphable/morphable_fit.h"
#include "nn/optim/lbfgs.h"
#include "render/morphable/builtin_head.h"

namespace stymo::stability {

namespace {

/// Pose and identity of a fit to the landmarks of the built-in head, moved by `change`.
StabilityCase landmarks(const std::string& name, const std::string& behaviour,
                        void (*change)(Eigen::Vector2d&)) {
    return {.name = name, .behaviour = behaviour, .value_bound = 1e-9, .run = [=](DType) {
                const MorphableHead head = builtin_head();
                MorphableFit frontal;
                frontal.pose = pivot_pose(0.0, 0.0, 0.0, 5.3, 0.9);
                frontal.identity.resize(100);
                frontal.expression.resize(79);
                Landmarks points = fitted_landmarks(head, frontal, {}, 256);
                for (Eigen::Vector2d& point : points) change(point);
                const MorphableFitTarget target{points, Tensor::full({256, 256, 3}, 0.5), {}};
                const MorphableFit fit =
                    fit_morphable(head, {&target, 1}, {}, {.pixels = false}).front();
                return StabilityResult{
                    .values = {tensor_from(Eigen::VectorXd(fit.pose.translation)),
                               Tensor::from({100}, std::span<const float>(fit.identity))}};
            }};
}

std::vector<StabilityCase> landmark_cases() {
    const auto to_a_line = [](Eigen::Vector2d& point) { point[1] = 0.5 * point[0] + 10.0; };
    return {
        landmarks("landmarks of a head", "the pose in closed form, then Levenberg-Marquardt",
                  [](Eigen::Vector2d&) {}),
        landmarks("landmarks near a line", "the priors keep the steps of Levenberg-Marquardt small",
                  [](Eigen::Vector2d& point) { point[1] = 100.0 + 0.01 * point[1]; }),
        refused<ValueError>("landmarks on a line", "refused: they leave the pose open", "line",
                            landmarks("", "", to_a_line).run),
        refused<ValueError>("landmarks at one point", "refused: they leave the pose open", "line",
                            landmarks("", "", [](Eigen::Vector2d& point) {
                                point = {100.0, 100.0};
                            }).run)};
}

/// The minimum of a sum of squares of very different curvatures, times a factor.
StabilityCase minimised(const std::string& name, const std::string& behaviour, double factor) {
    return {
        .name = name, .behaviour = behaviour, .value_bound = 1e-3, .run = [=](DType dtype) {
            const Eigen::VectorXd curvature = Eigen::VectorXd::LinSpaced(5, 1.0, 50.0);
            const Objective objective = [&](const Eigen::VectorXd& x) {
                const Eigen::VectorXd off = x.array() - 1.0;
                Eigen::VectorXd gradient = factor * curvature.cwiseProduct(off);
                if (dtype == DType::float32) gradient = gradient.cast<float>().cast<double>();
                return ValueAndGradient{0.5 * factor * curvature.dot(off.cwiseAbs2()), gradient};
            };
            Lbfgs lbfgs(Eigen::VectorXd::Zero(5));
            for (int i = 0; i < 40 && lbfgs.step(objective, 20); ++i) {
            }
            return StabilityResult{.values = {tensor_from(lbfgs.point())}};
        }};
}

std::vector<StabilityCase> lbfgs_cases() {
    const std::string same = "steps are relative to the gradient: the same minimum";
    return {minimised("L-BFGS, gradient 0", "no step", 0.0),
            minimised("L-BFGS, gradients of 1e-30", same, 1e-30),
            minimised("L-BFGS, gradients of 1", same, 1.0),
            minimised("L-BFGS, gradients of 1e30", same, 1e30)};
}

}  // namespace

std::vector<StabilityCase> fitting_cases() {
    return joined({landmark_cases(), lbfgs_cases()});
}

}  // namespace stymo::stability
