#include <limits>

#include "cases/stability/case.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "core/tensor_eigen.h"
#include "fit/morphable/morphable_fit.h"
#include "nn/optim/adam.h"
#include "nn/optim/ema.h"
#include "nn/optim/lbfgs.h"
#include "nn/optim/muon.h"
#include "render/morphable/builtin_head.h"
#include "support/fitted_landmarks.h"
#include "train/gradient_sums.h"

namespace stymo::stability {

namespace {

/// A parameter after ten steps of Adam at rate 1e-3 from 0, with the same gradient each time, then
/// ten with gradients of 1.
StabilityResult stepped(DType dtype, double gradient) {
    ParameterStore store;
    const Parameter x = store.create("x", Tensor::zeros({3}, dtype));
    Adam adam;
    StabilityResult result;
    for (const double slope : {gradient, 1.0}) {
        for (int step = 0; step < 10; ++step)
            adam.step(store.all(),
                      std::vector<Variable>{Tensor::full({3}, static_cast<float>(slope)).to(dtype)},
                      1e-3);
        result.values.push_back(x.variable().value());
    }
    return result;
}

std::vector<StabilityCase> adam_cases() {
    std::vector<StabilityCase> rows;
    const auto add = [&](std::string name, std::string behaviour, double gradient) {
        rows.push_back({.name = std::move(name),
                        .behaviour = std::move(behaviour),
                        .value_bound = 1e-5,
                        .run = [=](DType dtype) { return stepped(dtype, gradient); }});
    };
    add("Adam, gradient 0", "no step: 0 / (0 + 1e-8)", 0.0);
    add("Adam, gradient 1e-30", "its square underflows; epsilon decides the step either way",
        1e-30);
    add("Adam, gradient 1e18", "a step of the learning rate", 1e18);
    add("Adam, gradient 1e30", "taken as 1e18, whose square float32 holds; the step is the same",
        1e30);
    rows.push_back(refused<NumericError>(
        "Adam, gradient infinite", "refused before anything changes", "gradient of x",
        [](DType dtype) { return stepped(dtype, std::numeric_limits<double>::infinity()); }));
    rows.push_back(refused<NumericError>(
        "Adam, gradient not a number", "refused before anything changes", "gradient of x",
        [](DType dtype) { return stepped(dtype, std::numeric_limits<double>::quiet_NaN()); }));
    return rows;
}

/// A matrix after three steps of Muon with gradients of this magnitude.
StabilityCase muon(const std::string& name, const std::string& behaviour, double magnitude) {
    return {.name = name, .behaviour = behaviour, .value_bound = 1e-3, .run = [=](DType dtype) {
                ParameterStore store;
                const Parameter x = store.create("x", Tensor::zeros({16, 24}, dtype));
                Muon optimizer;
                for (std::uint64_t step = 0; step < 3; ++step)
                    optimizer.step(
                        store.all(),
                        std::vector<Variable>{Rng(step).normal({16, 24}, 0.0, magnitude).to(dtype)},
                        1e-3);
                return StabilityResult{.values = {x.variable().value()}};
            }};
}

std::vector<StabilityCase> muon_cases() {
    const std::string scaled = "scaled by a power of two where squares leave float32's range";
    std::vector<StabilityCase> rows{
        muon("Muon, gradient 0", "no step", 0.0), muon("Muon, gradients of 1e-30", scaled, 1e-30),
        muon("Muon, gradients of 1e-20", scaled, 1e-20),
        muon("Muon, gradients of 1", "a step of the learning rate", 1.0),
        muon("Muon, gradients of 1e30", scaled, 1e30)};
    rows.push_back(refused<NumericError>(
        "Muon, gradient infinite", "refused before anything changes", "gradient of x",
        muon("", "", std::numeric_limits<double>::infinity()).run));
    return rows;
}

std::vector<StabilityCase> accumulation_cases() {
    std::vector<StabilityCase> rows;
    rows.push_back({.name = "1e6 accumulated micro-steps",
                    .behaviour = "added in pairs, pairs in pairs: 20 roundings",
                    .value_bound = 1e-6,
                    .run = [](DType dtype) {
                        constexpr std::int64_t count = 1000000;
                        Tensor sum;
                        GradientTree tree(
                            count, [&sum](std::size_t, Tensor all) { sum = std::move(all); });
                        const Tensor gradient = Rng(1).uniform({4}, 0.5, 1.5).to(dtype);
                        for (std::int64_t i = 0; i < count; ++i) tree.add(i, 0, gradient);
                        return StabilityResult{.values = {(Variable(sum) * (1.0 / count)).value()}};
                    }});
    rows.push_back({.name = "1e5 steps of a moving average, decay 0.9999",
                    .behaviour = "moves by a part of the difference: a constant stays; stops at "
                                 "most half a rounding / (1 - decay) = 6e-4 short",
                    .value_bound = 1e-3,
                    .run = [](DType dtype) {
                        ParameterStore store;
                        const Parameter x =
                            store.create("x", Rng(2).uniform({4}, 0.5, 1.5).to(dtype));
                        Ema average(store.all());
                        x.set_value(Rng(3).uniform({4}, 1.5, 2.5).to(dtype));
                        for (int i = 0; i < 100000; ++i) average.update(0.9999);
                        average.swap();
                        return StabilityResult{.values = {x.variable().value()}};
                    }});
    rows.push_back(
        row("sum of 1e6 equal numbers 0.1", "16 numbers in each of 32 lanes, then float64", 1e-6,
            1e-6, {Tensor::full({1000000}, 0.1)}, each([](const Variable& x) { return sum(x); })));
    rows.push_back(row("column sums of 1e5 rows of 0.1",
                       "runs of 1024 rows, each added in the type itself", 1e-4, 1e-6,
                       {Tensor::full({100000, 2}, 0.1)},
                       each([](const Variable& x) { return sum(x, {0}); })));
    rows.push_back(refused<FileError>(
        "a weight in a file that is not a number", "refused when it is read", "layer.weight",
        [](DType dtype) {
            ParameterStore store;
            const Parameter weight = store.create("layer.weight", Tensor::zeros({2}, dtype));
            TensorFile file;
            file.tensors["layer.weight"] =
                Tensor::full({2}, std::numeric_limits<double>::quiet_NaN());
            store.load(file, "model.safetensors");
            return StabilityResult{.values = {weight.variable().value()}};
        }));
    return rows;
}

}  // namespace

std::vector<StabilityCase> training_cases() {
    return joined({adam_cases(), muon_cases(), accumulation_cases()});
}

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
                Landmarks points = stymo::test::fitted_landmarks(head, frontal, {}, 256);
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
