#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/displacement.h"
#include "render/rasterizer.h"

namespace {

using stymo::HeadPart;
using stymo::MorphableHead;
using stymo::Tensor;

const MorphableHead& head() {
    return stymo::builtin_head();
}

[[nodiscard]] std::vector<float> random_code(std::int64_t size, std::uint64_t seed) {
    const Tensor code = stymo::Rng(seed).normal({size}, 0.0, 1.0);
    return {code.values<float>().begin(), code.values<float>().end()};
}

[[nodiscard]] Eigen::Vector3d landmark(std::size_t k) {
    const auto* point =
        &head().mean.values<float>()[3 * static_cast<std::size_t>(head().landmarks[k])];
    return Eigen::Vector3f(point).cast<double>();
}

[[nodiscard]] stymo::Camera front() {
    return stymo::camera_from_pose({}, {});
}

}  // namespace

TEST_CASE("The built-in head has the sizes of its contract and finite values") {
    const std::int64_t count = head().vertex_count();
    CHECK(count > 8000);
    CHECK(count < 17000);
    CHECK(head().mean.shape() == stymo::Shape{count, 3});
    CHECK(head().mean_albedo.shape() == stymo::Shape{count, 3});
    CHECK(head().identity.shape() == stymo::Shape{100, count, 3});
    CHECK(head().expression.shape() == stymo::Shape{79, count, 3});
    CHECK(head().albedo.shape() == stymo::Shape{100, count, 3});
    CHECK(static_cast<std::int64_t>(head().parts.size()) == count);
    for (const Tensor& tensor :
         {head().mean, head().mean_albedo, head().identity, head().expression, head().albedo})
        CHECK(tensor.all_finite());
    std::set<HeadPart> parts(head().parts.begin(), head().parts.end());
    CHECK(parts.size() == 7);
}

TEST_CASE("The bases of the built-in head do not depend on the number of threads") {
    const stymo::morphable::HeadMesh mesh = stymo::morphable::generate_head({});
    const auto bases = [&](int threads) {
        stymo::set_thread_count(threads);
        std::array<bool, MorphableHead::expression_size> one_sided{};
        return std::array{stymo::morphable::identity_basis(mesh),
                          stymo::morphable::expression_basis(mesh, one_sided),
                          stymo::morphable::texture_basis(mesh.vertices, mesh.parts, mesh.albedo)};
    };
    const auto one = bases(1), three = bases(3);
    stymo::set_thread_count(0);
    CHECK((one == three));
}

TEST_CASE("No row of a basis is zero and no two are the same") {
    for (const Tensor& basis : {head().identity, head().expression, head().albedo}) {
        const std::size_t length = static_cast<std::size_t>(basis.shape(1)) * 3;
        std::set<double> norms;
        for (std::size_t k = 0; k < static_cast<std::size_t>(basis.shape(0)); ++k) {
            double norm = 0.0;
            for (const float value : basis.values<float>().subspan(k * length, length))
                norm += static_cast<double>(value) * static_cast<double>(value);
            CHECK(norm > 0.0);
            norms.insert(norm);
        }
        CHECK(norms.size() == static_cast<std::size_t>(basis.shape(0)));
    }
}

TEST_CASE("Each part of the head is a consistently wound surface whose normals point outwards") {
    std::map<std::pair<std::int32_t, std::int32_t>, int> edges;
    for (const auto& triangle : head().triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            REQUIRE(triangle[k] >= 0);
            REQUIRE(triangle[k] < head().vertex_count());
            ++edges[{triangle[k], triangle[(k + 1) % 3]}];
        }
    }
    std::int64_t open = 0;
    for (const auto& [edge, uses] : edges) {
        CHECK(uses == 1);
        if (!edges.contains({edge.second, edge.first})) ++open;
    }
    // Rims: crown, throat, hair, backs of the eyes, ends of the ears, brows.
    CHECK(open < static_cast<std::int64_t>(edges.size()) / 50);

    const Tensor normals = stymo::vertex_normals(head().mean, head().triangles);
    const auto points = head().mean.values<float>();
    const auto directions = normals.values<float>();
    std::map<HeadPart, std::pair<double, double>> outward;
    for (std::size_t vertex = 0; vertex < head().parts.size(); ++vertex) {
        const HeadPart part = head().parts[vertex];
        if (part != HeadPart::skin && part != HeadPart::hair && part != HeadPart::ears) continue;
        const double center_x =
            part == HeadPart::ears ? std::copysign(0.70, points[3 * vertex]) : 0.0;
        const double dot =
            static_cast<double>(directions[3 * vertex]) *
                (static_cast<double>(points[3 * vertex]) - center_x) +
            static_cast<double>(directions[3 * vertex + 1] * points[3 * vertex + 1]) +
            static_cast<double>(directions[3 * vertex + 2] * (points[3 * vertex + 2] + 0.05F));
        outward[part].first += dot > 0.0 ? 1.0 : 0.0;
        outward[part].second += 1.0;
    }
    for (const auto& [part, counts] : outward)
        CHECK(counts.first / counts.second > (part == HeadPart::ears ? 0.7 : 0.93));
}

TEST_CASE("Landmarks lie in dlib's order on the features they name") {
    for (std::size_t k = 0; k < 17; ++k) {
        CHECK(landmark(k)[0] == Approx(-landmark(16 - k)[0]).margin(0.02));
        if (k > 0) CHECK(landmark(k)[0] > landmark(k - 1)[0]);
    }
    CHECK(landmark(8)[1] < -0.85);
    for (std::size_t k = 18; k <= 26; ++k) CHECK(landmark(k)[0] > landmark(k - 1)[0]);
    for (std::size_t k = 28; k <= 30; ++k) CHECK(landmark(k)[1] < landmark(k - 1)[1]);
    for (const std::size_t tip_neighbour : {27, 28, 31, 33, 35})
        CHECK(landmark(30)[2] > landmark(tip_neighbour)[2]);
    CHECK(landmark(36)[0] == Approx(-0.45).margin(0.02));
    CHECK(landmark(39)[0] == Approx(-0.15).margin(0.02));
    CHECK(landmark(42)[0] == Approx(0.15).margin(0.02));
    CHECK(landmark(45)[0] == Approx(0.45).margin(0.02));
    for (const auto& [upper, lower] :
         {std::pair<std::size_t, std::size_t>{37, 41}, {38, 40}, {43, 47}, {44, 46}}) {
        CHECK(landmark(upper)[1] - landmark(lower)[1] > 0.07);
    }
    CHECK(landmark(54)[0] - landmark(48)[0] > 0.4);
    CHECK(landmark(51)[1] - landmark(57)[1] > 0.08);
    for (std::size_t k = 48; k < 68; ++k)
        CHECK(head().parts[static_cast<std::size_t>(head().landmarks[k])] == HeadPart::lips);
}

TEST_CASE(
    "The default pose frames the head and shows eyes, lips, brows and hair where they belong") {
    const auto image =
        stymo::rasterize(head().mean, head().mean_albedo, head().triangles, front(), {128, 128, 2});
    const auto part_at = [&](const Eigen::Vector3d& point) {
        const Eigen::Vector3d pixel = stymo::project(front(), point);
        const auto index = static_cast<std::size_t>(pixel[1] * 128.0) * 128 +
                           static_cast<std::size_t>(pixel[0] * 128.0);
        REQUIRE(image.triangle[index] >= 0);
        return head().parts[static_cast<std::size_t>(
            head().triangles[static_cast<std::size_t>(image.triangle[index])][0])];
    };
    CHECK(part_at({-0.30, 0.06, 0.7}) == HeadPart::eyes);
    CHECK(part_at({0.30, 0.06, 0.7}) == HeadPart::eyes);
    CHECK(part_at({0.0, -0.565, 0.85}) == HeadPart::lips);
    CHECK(part_at({0.28, 0.245, 0.8}) == HeadPart::brows);
    CHECK(part_at({0.0, -0.2, 1.0}) == HeadPart::skin);
    CHECK(part_at({0.0, 0.95, 0.3}) == HeadPart::hair);
    double covered = 0.0;
    const auto coverage = image.coverage.values<float>();
    for (std::size_t pixel = 0; pixel < coverage.size(); ++pixel) {
        covered += static_cast<double>(coverage[pixel]) / 16384.0;
        const std::size_t row = pixel / 128;
        const std::size_t column = pixel % 128;
        if (row == 0 || row == 127 || column == 0 || column == 127) CHECK(coverage[pixel] == 0.0F);
    }
    CHECK(covered > 0.35);
    CHECK(covered < 0.75);
}

TEST_CASE("Zero codes give the mean, and the head is linear in its codes") {
    const std::vector<float> no_identity(100, 0.0F);
    const std::vector<float> no_expression(79, 0.0F);
    CHECK(stymo::head_vertices(head(), no_identity, no_expression).to_vector() ==
          head().mean.to_vector());

    const auto identity = random_code(100, 1);
    const auto expression = random_code(79, 2);
    const auto both = stymo::head_vertices(head(), identity, expression).to_vector();
    const auto first = stymo::head_vertices(head(), identity, no_expression).to_vector();
    const auto second = stymo::head_vertices(head(), no_identity, expression).to_vector();
    const auto mean = head().mean.to_vector();
    double worst = 0.0;
    double moved = 0.0;
    for (std::size_t i = 0; i < both.size(); ++i) {
        worst = std::max(worst, std::abs(both[i] - first[i] - second[i] + mean[i]));
        moved = std::max(moved, std::abs(both[i] - mean[i]));
    }
    CHECK(worst < 2e-6);
    CHECK(moved > 0.05);
    CHECK(moved < 1.2);
    CHECK_THROWS_AS(stymo::head_vertices(head(), std::vector<float>(99), no_expression),
                    stymo::ShapeError);
}

TEST_CASE("The first expression opens the jaw and the next two close the lids") {
    const std::vector<float> no_identity(100, 0.0F);
    std::vector<float> expression(79, 0.0F);
    expression[0] = 2.0F;
    expression[1] = 4.0F;
    const Tensor moved = stymo::head_vertices(head(), no_identity, expression);
    const auto height = [&](std::size_t k) {
        return static_cast<double>(
            moved.values<float>()[3 * static_cast<std::size_t>(head().landmarks[k]) + 1]);
    };
    CHECK(height(62) - height(66) > 0.08);
    CHECK(landmark(62)[1] - landmark(66)[1] < 0.03);
    CHECK(height(37) - height(41) < 0.4 * (landmark(37)[1] - landmark(41)[1]));
    CHECK(height(44) - height(46) == Approx(landmark(44)[1] - landmark(46)[1]).margin(1e-6));
}

TEST_CASE("Albedo stays a colour for any code") {
    auto texture = random_code(100, 3);
    for (float& value : texture) value *= 5.0F;
    for (const double value : stymo::head_albedo(head(), texture).to_vector()) {
        REQUIRE(value >= 0.0199);
        REQUIRE(value <= 1.0);
    }
    CHECK_THROWS_AS(stymo::head_albedo(head(), std::vector<float>(1)), stymo::ShapeError);
}
