#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "fit/morphable/landmark_term.h"
#include "fit/morphable/least_squares.h"
#include "fit/morphable/state.h"
#include "fit/morphable/vertex_table.h"
#include "render/morphable/builtin_head.h"
#include "support/morphable_state.h"

namespace {

namespace morphable = stymo::morphable;
using stymo::Tensor;
using stymo::Variable;

/// Made once: it takes longer than most of these tests.
[[nodiscard]] const stymo::MorphableHead& own_head() {
    return stymo::builtin_head();
}

/// A state away from anything special: every unknown is at work.
[[nodiscard]] morphable::State some_state() {
    stymo::Rng rng(11);
    morphable::State state(morphable::state_size);
    for (double& value : state) value = 0.3 * rng.normal();
    const auto pose = stymo::test::pose_numbers({0.3, -0.2, 0.15, {1.4, -0.9, 4.9}});
    std::copy(pose.begin(), pose.end(), state.begin());
    return state;
}

}  // namespace

TEST_CASE("The differentiable camera is the camera") {
    const stymo::Pose pose{0.4, -0.3, 0.2, {1.5, -0.6, 4.8}};
    const Eigen::Vector3d point{0.3, -0.5, 0.9};
    const auto numbers = stymo::test::pose_numbers(pose);
    const Variable poses(Tensor::from({1, 6}, std::span<const double>(numbers)));
    const Variable points(Tensor::from({1, 3}, std::span(point.data(), 3)));
    const Tensor seen =
        morphable::image_points(morphable::camera_points(poses, points), {}).value();
    const Eigen::Vector3d expected = stymo::project(stymo::camera_from_pose(pose, {}), point);
    CHECK(seen.values<double>()[0] == Approx(expected[0]).epsilon(1e-12));
    CHECK(seen.values<double>()[1] == Approx(expected[1]).epsilon(1e-12));
    const stymo::Pose back = morphable::pose_of(numbers);
    for (std::size_t axis = 0; axis < 3; ++axis)
        CHECK(back.translation[axis] == Approx(pose.translation[axis]));
}

TEST_CASE("The landmarks' gradient is the slope of their cost") {
    const stymo::MorphableHead& head = own_head();
    const morphable::Contour contour(head);
    morphable::State state = some_state();
    stymo::Landmarks landmarks;
    for (std::size_t k = 0; k < landmarks.size(); ++k)
        landmarks[k] = {0.4 + 0.002 * static_cast<double>(k), 0.5};
    morphable::LandmarkTerm term(contour, landmarks, {}, {});
    term.hold(state);
    morphable::NormalEquations equations(morphable::state_size);
    term.add_to(equations, state);
    CHECK(equations.cost == Approx(term.cost(state)));
    for (const std::size_t i : {0, 1, 2, 3, 4, 5, 6, 57, 105, 106, 110, 150, 184}) {
        constexpr double step = 1e-5;
        morphable::State more = state;
        morphable::State less = state;
        more[i] += step;
        less[i] -= step;
        INFO("unknown " << i);
        CHECK(
            equations.gradient[i] ==
            Approx((term.cost(more) - term.cost(less)) / (2.0 * step)).epsilon(1e-4).margin(1e-3));
    }
}

TEST_CASE("Least squares stop at the bounds of the unknowns") {
    // (x - 1)^2 + (y + 2)^2 + (x y - 3)^2 / 10 with y >= 0 has its minimum at x = 1, y = 0, up to a
    // constant.
    morphable::LeastSquaresProblem problem;
    problem.fixed = {false, false, true};
    problem.non_negative = {false, true, false};
    problem.linearized = [](std::span<const double> x) {
        morphable::NormalEquations equations(3);
        equations.add(std::array{1.0}, 0, x[0] - 1.0, 2.0);
        equations.add(std::array{1.0}, 1, x[1] + 2.0, 2.0);
        equations.add(std::array{x[1], x[0]}, 0, x[0] * x[1] - 3.0, 0.2);
        return equations;
    };
    problem.cost = [&](std::span<const double> x) { return problem.linearized(x).cost; };
    const std::vector<double> found = morphable::minimized(problem, {4.0, 3.0, 7.0}, 30);
    CHECK(found[0] == Approx(1.0).margin(1e-6));
    CHECK(found[1] == 0.0);
    CHECK(found[2] == 7.0);
    CHECK_FALSE(morphable::damped_step(morphable::NormalEquations(2), 0.0, {false, false}));
}

TEST_CASE("Least squares damp a matrix that is not positive definite, and give up in the end") {
    // (x + y - 2)^2 / 2 + (x - 1)^2 / 2 with a matrix whose off-diagonal part is too large, as
    // rounding makes it: the matrix is positive definite only with more than the first damping.
    morphable::LeastSquaresProblem problem;
    problem.fixed = problem.non_negative = {false, false};
    double too_much = 0.5;
    problem.linearized = [&](std::span<const double> x) {
        morphable::NormalEquations equations(2);
        equations.add(std::array{1.0, 1.0}, 0, x[0] + x[1] - 2.0, 1.0);
        equations.add(std::array{1.0}, 0, x[0] - 1.0, 1.0);
        equations.matrix(1, 0) += too_much;
        return equations;
    };
    problem.cost = [&](std::span<const double> x) { return problem.linearized(x).cost; };
    const std::vector<double> start{4.0, 3.0};
    REQUIRE_FALSE(morphable::damped_step(problem.linearized(start), 1e-3, {false, false}));
    const std::vector<double> found = morphable::minimized(problem, start, 200);
    CHECK(found[0] == Approx(1.0).margin(1e-3));
    CHECK(found[1] == Approx(1.0).margin(1e-3));
    too_much = 1e6;
    CHECK_THROWS_AS(morphable::minimized(problem, start, 200), stymo::NumericError);
}

TEST_CASE("The jaw slides on the side that turns away and stays on the other") {
    const stymo::MorphableHead& head = own_head();
    const morphable::Contour contour(head);
    const morphable::State neutral(morphable::state_size, 0.0);
    const std::vector<double> points = morphable::table_points(contour.table(), neutral);
    const auto seen_from = [&](double yaw) {
        return contour.rows(points,
                            stymo::camera_from_pose(stymo::orbit_pose(yaw, 0.0, 0.0, 5.3), {}));
    };
    const auto depth = [&](std::size_t row) { return points[3 * row + 2]; };
    // The camera at the image's right sees the left cheek as outline.
    const auto right = seen_from(0.6);
    const auto left = seen_from(-0.6);
    for (std::size_t k = 1; k < 6; ++k) {
        CHECK(depth(right[k]) > depth(k) + 0.05);
        CHECK(depth(right[16 - k]) == Approx(depth(16 - k)).margin(0.05));
        CHECK(depth(left[16 - k]) > depth(16 - k) + 0.05);
        CHECK(depth(left[k]) == Approx(depth(k)).margin(0.05));
    }
    for (std::size_t k = 17; k < 68; ++k) CHECK(right[k] == k);
}

TEST_CASE("The affine pose of a distant camera is exact") {
    const stymo::MorphableHead& head = own_head();
    const morphable::Contour contour(head);
    const stymo::Intrinsics telephoto{400.0, 0.4, 0.6};
    const stymo::Pose pose = stymo::orbit_pose(0.9, -0.3, 0.6, 1000.0);
    const stymo::Camera camera = stymo::camera_from_pose(pose, telephoto);
    stymo::Landmarks landmarks;
    for (std::size_t k = 0; k < landmarks.size(); ++k) {
        const Eigen::Vector3f point(&contour.table().mean[3 * k]);
        landmarks[k] = stymo::project(camera, point.cast<double>()).head<2>();
    }
    const auto numbers = morphable::affine_pose(contour, landmarks, telephoto);
    CHECK(numbers[0] == Approx(pose.yaw).margin(1e-3));
    CHECK(numbers[1] == Approx(pose.pitch).margin(1e-3));
    CHECK(numbers[2] == Approx(pose.roll).margin(1e-3));
    CHECK(numbers[5] == Approx(1000.0).epsilon(1e-3));
}
