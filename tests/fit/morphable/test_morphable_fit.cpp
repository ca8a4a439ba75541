#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <numeric>

#include "core/angle.h"
#include "core/error.h"
#include "core/median.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/photo/face_detector.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/head_source.h"
#include "shared_data.h"
#include "support/error_message.h"
#include "support/fitted_landmarks.h"
#include "support/thread_count.h"
#include "train/data/synthetic_faces.h"

namespace morphable_fit_tests {

namespace {

using stymo::radians_from_degrees;
using stymo::Tensor;

constexpr std::int64_t side = 256;

/// For landmarks of the jaw that err no more than the others.
constexpr stymo::MorphableFitOptions precise_jaw{.jaw_deviation = 0.02};

/// Made once: it takes longer than most of these tests.
[[nodiscard]] const stymo::MorphableHead& own_head() {
    return stymo::builtin_head();
}

/// Faces of known truth, seen from everywhere.
[[nodiscard]] stymo::SyntheticFace random_face(const stymo::MorphableHead& head, stymo::Rng rng,
                                               double yaw_limit) {
    stymo::SyntheticFace face = stymo::sample_synthetic_face(head, rng.split("face"));
    const auto angle = [&](double limit) {
        return radians_from_degrees(limit * (2.0 * rng.uniform() - 1.0));
    };
    const double yaw = angle(yaw_limit);
    const double pitch = angle(15.0);
    face.pose = stymo::orbit_pose(yaw, pitch, angle(10.0), 5.3 + 0.2 * rng.normal());
    return face;
}

[[nodiscard]] stymo::MorphableFit truth_of(const stymo::SyntheticFace& face) {
    return {face.pose, face.identity, face.expression, face.texture, face.light, 0.0};
}

/// The rendering with noise, and landmarks that err as a detector's do, by `deviation` in units of
/// the side.
[[nodiscard]] stymo::MorphableFitTarget target_of(const stymo::MorphableHead& head,
                                                  const stymo::SyntheticFace& face,
                                                  double deviation, stymo::Rng rng) {
    const stymo::SyntheticImage image = stymo::render_synthetic_face(head, face, {}, side);
    stymo::MorphableFitTarget target{stymo::test::fitted_landmarks(head, truth_of(face), {}, side),
                                     image.color, image.mask};
    for (auto& point : target.landmarks) {
        for (double& coordinate : point)
            coordinate += deviation * static_cast<double>(side) * rng.normal();
    }
    for (float& value : target.image.mutable_values<float>())
        value = std::clamp(value + 0.02F * static_cast<float>(rng.normal()), 0.0F, 1.0F);
    return target;
}

[[nodiscard]] double degrees_between(const stymo::Pose& a, const stymo::Pose& b) {
    const Eigen::Matrix3d first = stymo::rotation_from_angles(a.yaw, a.pitch, a.roll);
    const Eigen::Matrix3d second = stymo::rotation_from_angles(b.yaw, b.pitch, b.roll);
    const double trace = (first * second.transpose()).trace();
    return stymo::degrees_from_radians(std::acos(std::clamp((trace - 1.0) / 2.0, -1.0, 1.0)));
}

/// Root mean square distance from the true landmarks, in units of the side.
[[nodiscard]] double truth_error(const stymo::MorphableHead& head, const stymo::SyntheticFace& face,
                                 const stymo::MorphableFit& fit) {
    const stymo::Landmarks truth = stymo::test::fitted_landmarks(head, truth_of(face), {}, 1);
    const stymo::Landmarks found = stymo::test::fitted_landmarks(head, fit, {}, 1);
    double sum = 0.0;
    for (std::size_t k = 0; k < truth.size(); ++k)
        sum += std::pow(truth[k][0] - found[k][0], 2) + std::pow(truth[k][1] - found[k][1], 2);
    return std::sqrt(sum / 68.0);
}

/// Mean squared difference of the fitted head's colours and the image's, on the head.
[[nodiscard]] double color_error(const stymo::MorphableHead& head,
                                 const stymo::MorphableFitTarget& target,
                                 const stymo::MorphableFit& fit) {
    const stymo::SyntheticFace face{fit.identity, fit.expression, fit.texture, fit.light, fit.pose};
    const stymo::SyntheticImage image = stymo::render_synthetic_face(head, face, {}, side);
    const auto a = image.color.values<float>();
    const auto b = target.image.values<float>();
    const auto mask = target.mask.values<float>();
    const auto fitted_mask = image.mask.values<float>();
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (mask[i / 3] < 0.5F || fitted_mask[i / 3] < 0.5F) continue;
        sum += std::pow(static_cast<double>(a[i] - b[i]), 2);
        count += 1.0;
    }
    return sum / count;
}

}  // namespace

TEST_CASE("Exact landmarks of a head at large angles bring back its pose") {
    const stymo::MorphableHead& head = own_head();
    std::vector<stymo::MorphableFitTarget> targets;
    std::vector<stymo::Pose> poses;
    for (const double yaw : {-60.0, -30.0, 0.0, 45.0, 60.0}) {
        for (const double roll : {-40.0, 0.0, 25.0}) {
            stymo::MorphableFit truth{
                stymo::orbit_pose(radians_from_degrees(yaw), radians_from_degrees(yaw / 6.0),
                                  radians_from_degrees(roll), 5.2),
                std::vector<float>(100),
                std::vector<float>(79),
                std::vector<float>(100),
                std::vector<float>(27),
                0.0};
            poses.push_back(truth.pose);
            targets.push_back({stymo::test::fitted_landmarks(head, truth, {}, side),
                               Tensor::zeros({side, side, 3}),
                               {}});
        }
    }
    const auto fits = stymo::fit_morphable(head, targets, {}, {.pixels = false});
    for (std::size_t i = 0; i < fits.size(); ++i) {
        INFO("yaw " << stymo::degrees_from_radians(poses[i].yaw) << " roll "
                    << stymo::degrees_from_radians(poses[i].roll));
        CHECK(degrees_between(fits[i].pose, poses[i]) < 1.0);
        CHECK(fits[i].landmark_error < 0.003);
    }
}

TEST_CASE("Noisy landmarks and colours of random heads bring back pose, shape and colours") {
    const stymo::MorphableHead& head = own_head();
    const stymo::Rng rng(3);
    std::vector<stymo::SyntheticFace> faces;
    std::vector<stymo::MorphableFitTarget> targets;
    for (std::uint64_t i = 0; i < 5; ++i) {
        faces.push_back(random_face(head, rng.split(i), 30.0));
        targets.push_back(target_of(head, faces.back(), 0.005, rng.split(100 + i)));
    }
    stymo::MorphableFitOptions options = precise_jaw;
    const auto with_colors = stymo::fit_morphable(head, targets, {}, options);
    options.pixels = false;
    const auto without = stymo::fit_morphable(head, targets, {}, options);
    std::vector<double> angles, errors, gains;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        angles.push_back(degrees_between(with_colors[i].pose, faces[i].pose));
        errors.push_back(truth_error(head, faces[i], with_colors[i]));
        gains.push_back(color_error(head, targets[i], without[i]) /
                        color_error(head, targets[i], with_colors[i]));
        for (std::size_t k = 0; k < head.one_sided.size(); ++k)
            CHECK((!head.one_sided[k] || with_colors[i].expression[k] >= 0.0F));
    }
    CHECK(stymo::median(angles) < 2.0);
    CHECK(stymo::median(errors) < 0.006);
    CHECK(stymo::median(gains) > 2.0);
}

TEST_CASE("A known identity is kept, and the landmarks then tell the expression better") {
    const stymo::MorphableHead& head = own_head();
    const stymo::Rng rng(7);
    const std::vector<float> mean(100);
    const auto moved = [&](const std::vector<float>& expression) {
        return stymo::head_vertices(head, mean, expression).to_vector();
    };
    bool kept = true;
    std::vector<double> ratios;
    for (std::uint64_t i = 0; i < 9; ++i) {
        const stymo::SyntheticFace face = random_face(head, rng.split(i), 20.0);
        stymo::MorphableFitTarget target = target_of(head, face, 0.001, rng.split(100 + i));
        const auto error = [&] {
            const auto fits = stymo::fit_morphable(head, {&target, 1}, {}, {.pixels = false});
            if (!target.identity.empty()) kept = kept && fits.front().identity == face.identity;
            const std::vector<double> found = moved(fits.front().expression),
                                      truth = moved(face.expression);
            double sum = 0.0;
            constexpr std::size_t first_of_mouth = 48;
            for (std::size_t k = first_of_mouth; k < head.landmarks.size(); ++k)
                for (std::size_t axis = 0; axis < 2; ++axis) {
                    const auto at = 3 * static_cast<std::size_t>(head.landmarks[k]) + axis;
                    sum += std::pow(found[at] - truth[at], 2);
                }
            return std::sqrt(sum);
        };
        const double unknown = error();
        target.identity = face.identity;
        ratios.push_back(error() / unknown);
    }
    CHECK(kept);
    CHECK(stymo::median(ratios) < 0.8);
}

TEST_CASE("An outline that a detector puts too far to one side hardly turns the head") {
    const stymo::MorphableHead& head = own_head();
    const stymo::MorphableFit truth{stymo::orbit_pose(radians_from_degrees(35.0), 0.0, 0.0, 5.3),
                                    std::vector<float>(100),
                                    std::vector<float>(79),
                                    std::vector<float>(100),
                                    std::vector<float>(27),
                                    0.0};
    stymo::MorphableFitTarget target{
        stymo::test::fitted_landmarks(head, truth, {}, side), Tensor::zeros({side, side, 3}), {}};
    constexpr std::size_t jaw_points = 17;
    for (std::size_t k = 0; k < jaw_points; ++k) target.landmarks[k][0] += 0.03 * side;
    const auto degrees_off = [&](double jaw_deviation) {
        const auto fits = stymo::fit_morphable(head, {&target, 1}, {},
                                               {.pixels = false, .jaw_deviation = jaw_deviation});
        return degrees_between(fits[0].pose, truth.pose);
    };
    CHECK(degrees_off(stymo::MorphableFitOptions{}.jaw_deviation) <
          0.5 * degrees_off(precise_jaw.jaw_deviation));
}

TEST_CASE("A photo's fit does not depend on its company or the number of threads") {
    const stymo::MorphableHead& head = own_head();
    std::vector<stymo::MorphableFitTarget> targets;
    for (std::uint64_t i = 0; i < 3; ++i)
        targets.push_back(
            target_of(head, random_face(head, stymo::Rng(5).split(i), 30.0), 0.005, stymo::Rng(i)));
    const stymo::MorphableFitOptions short_fit{.landmark_steps = 4, .pixel_steps = 1};
    const auto together = stymo::fit_morphable(head, targets, {}, short_fit);
    const stymo::test::ThreadCount keep_threads;
    stymo::set_thread_count(1);
    const auto alone = stymo::fit_morphable(head, std::span(targets).subspan(1, 1), {}, short_fit);
    CHECK(alone[0].identity == together[1].identity);
    CHECK(alone[0].light == together[1].light);
    CHECK(alone[0].pose.yaw == together[1].pose.yaw);
}

TEST_CASE("What cannot be fitted is refused in one line") {
    const stymo::MorphableHead& head = own_head();
    const auto refusal = [&](const stymo::MorphableFitTarget& target) {
        return stymo::test::error_message([&] {
            static_cast<void>(
                stymo::fit_morphable(head, std::span(&target, 1), {}, {.pixels = false}));
        });
    };
    stymo::MorphableFitTarget target{{}, Tensor::zeros({4, 5, 3}), {}};
    CHECK_THAT(refusal(target), Catch::Contains("square"));
    target.image = Tensor::zeros({4, 4, 3});
    target.mask = Tensor::zeros({5, 5, 1});
    CHECK_THAT(refusal(target), Catch::Contains("mask"));
    target.mask = {};
    target.identity.resize(99);
    CHECK_THAT(refusal(target), Catch::Contains("identity has 100 numbers; got 99"));
    target.identity.clear();
    CHECK_THAT(refusal(target), Catch::Contains("line"));  // all landmarks at one point
    target.landmarks[3][1] = std::nan("");
    CHECK_THAT(refusal(target), Catch::Contains("finite"));
}

TEST_CASE(
    "Scanned heads of known truth are found within 2 degrees and 1.5 percent of the image side",
    "[slow]") {
    const auto path = stymo::shared_data("data/ict_face.safetensors");
    if (!path) return;
    const stymo::MorphableHead head = stymo::read_morphable_head(*path);
    const stymo::Rng rng(7);
    std::vector<stymo::SyntheticFace> faces;
    std::vector<stymo::MorphableFitTarget> targets;
    for (std::uint64_t i = 0; i < 100; ++i) {
        faces.push_back(random_face(head, rng.split(i), 40.0));
        targets.push_back(target_of(head, faces.back(), 0.005, rng.split(1000 + i)));
    }
    const auto report = [&](const char* landmarks, const std::vector<std::size_t>& which) {
        const auto fits = stymo::fit_morphable(head, targets, {}, precise_jaw);
        std::vector<double> angles, errors, given_errors;
        for (std::size_t i = 0; i < fits.size(); ++i) {
            angles.push_back(degrees_between(fits[i].pose, faces[which[i]].pose));
            errors.push_back(truth_error(head, faces[which[i]], fits[i]));
            given_errors.push_back(fits[i].landmark_error);
        }
        std::cout << landmarks << " landmarks, " << fits.size() << " heads: rotation "
                  << stymo::median(angles) << " degrees, true landmarks "
                  << 100.0 * stymo::median(errors) << " %, given ones "
                  << 100.0 * stymo::median(given_errors) << " % of the side\n";
        return std::array{stymo::median(angles), stymo::median(errors),
                          stymo::median(given_errors)};
    };
    std::vector<std::size_t> which(faces.size());
    std::iota(which.begin(), which.end(), std::size_t{0});
    const auto [angle, error, given_error] = report("perturbed true", which);
    CHECK(angle < 2.0);
    CHECK(error < 0.015);
    CHECK(given_error < 0.015);
    if (!stymo::FaceDetector::available()) return;
    // What dlib takes for the jaw of a head without neck is a point of its own; the figures are for
    // the record.
    const stymo::FaceDetector detector;
    std::vector<stymo::MorphableFitTarget> detected;
    which.clear();
    for (std::size_t i = 0; i < targets.size(); ++i) {
        const auto found = detector.find(targets[i].image);
        if (found.empty()) continue;
        which.push_back(i);
        detected.push_back(targets[i]);
        detected.back().landmarks = found[0].landmarks;
    }
    targets = std::move(detected);
    CHECK(report("dlib's", which)[2] < 0.015);
}

}  // namespace morphable_fit_tests
