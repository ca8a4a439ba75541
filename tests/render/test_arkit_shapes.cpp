#include <algorithm>
#include <catch2/catch.hpp>

#include "core/tensor_eigen.h"
#include "render/morphable/arkit_shapes.h"
#include "render/morphable/builtin_head.h"

namespace arkit_shapes_tests {

namespace {

using stymo::ArkitSource;

std::size_t number_of(const std::string& name) {
    return static_cast<std::size_t>(std::ranges::find(stymo::arkit_names, name) -
                                    stymo::arkit_names.begin());
}

/// A head of three vertices whose expressions move all of them, the first by 1, the second by 2...
stymo::MorphableHead head_with(std::vector<std::string> names) {
    stymo::MorphableHead head;
    head.mean = stymo::Tensor::zeros({3, 3});
    head.expression = stymo::Tensor({79, 3, 3});
    const auto values = head.expression.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = 1.0F + float(i / 9);
    head.expression_names = std::move(names);
    return head;
}

}  // namespace

TEST_CASE("ICT-FaceKit's names are ARKit's, with their sides, and two of them are sums",
          "[arkit]") {
    const stymo::ArkitShapes shapes = stymo::arkit_shapes(
        head_with({"jawOpen", "eyeBlink_L", "browInnerUp_L", "browInnerUp_R", "mouthLeft"}));
    const auto first = [&](const char* name) {
        return stymo::matrix_map<float>(shapes.displacement)(
            static_cast<Eigen::Index>(3 * number_of(name)), 0);
    };
    CHECK(shapes.source[number_of("jawOpen")] == ArkitSource::exact);
    CHECK(first("jawOpen") == 4.0F);
    CHECK(shapes.recipe[number_of("eyeBlinkLeft")] == "4 eyeBlink_L");
    CHECK(first("eyeBlinkLeft") == 8.0F);
    CHECK(shapes.source[number_of("eyeBlinkRight")] == ArkitSource::missing);
    CHECK(first("eyeBlinkRight") == 0.0F);
    CHECK(shapes.source[number_of("browInnerUp")] == ArkitSource::composed);
    CHECK(first("browInnerUp") == 4.0F * (3.0F + 4.0F));
    CHECK(shapes.source[number_of("mouthLeft")] == ArkitSource::exact);
    for (const ArkitSource source : stymo::arkit_shapes(head_with({})).source)
        CHECK(source == ArkitSource::missing);
}

TEST_CASE("The built-in head closes the person's left eye at positive x, and halves add up",
          "[arkit]") {
    const stymo::MorphableHead& head = stymo::builtin_head();
    const stymo::ArkitShapes shapes = stymo::arkit_shapes(head);
    const auto rows = [&](const char* name) -> Eigen::MatrixXf {
        return stymo::matrix_map<float>(shapes.displacement)
            .middleRows(static_cast<Eigen::Index>(number_of(name)) * head.vertex_count(),
                        head.vertex_count());
    };
    const auto mean = stymo::matrix_map<float>(head.mean);
    const Eigen::MatrixXf left = rows("eyeBlinkLeft");
    Eigen::Index most = 0;
    left.rowwise().norm().maxCoeff(&most);
    CHECK(mean(most, 0) > 0.1F);
    CHECK(left(most, 1) < 0.0F);
    for (Eigen::Index i = 0; i < left.rows(); ++i)
        if (mean(i, 0) < 0.0F) REQUIRE(left.row(i).norm() < 1e-5F);
    const auto row =
        std::ranges::find(head.expression_names, "noseSneer") - head.expression_names.begin();
    const Eigen::MatrixXf whole =
        2.5F * stymo::matrix_map<float>(head.expression)
                   .middleRows(row * head.vertex_count(), head.vertex_count());
    CHECK((rows("noseSneerLeft") + rows("noseSneerRight") - whole).cwiseAbs().maxCoeff() < 1e-6F);
    CHECK(rows("jawLeft").col(0).sum() > 0.0F);
    CHECK(rows("eyeLookOutRight").col(0).sum() < 0.0F);
    CHECK(rows("tongueOut").isZero());
}

}  // namespace arkit_shapes_tests
