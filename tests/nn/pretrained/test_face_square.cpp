#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/io/image.h"
#include "nn/pretrained/face_square.h"

using namespace stymo;

namespace {

/// Two rows of points with eyes on a line that falls to the right by `angle`.
FacePoints turned_points(double angle) {
    FacePoints points;
    const Eigen::Vector2d right(std::cos(angle), std::sin(angle)), down(-right.y(), right.x());
    for (std::size_t k = 0; k < points.size(); ++k)
        points[k] = Eigen::Vector2d(100.0, 80.0) + (static_cast<double>(k % 17) - 8.0) * right +
                    (k < 17 ? 12.0 : 3.0) * down;
    for (std::size_t k = 36; k < 48; ++k)
        points[k] = Eigen::Vector2d(100.0, 80.0) + (k < 42 ? -4.0 : 4.0) * right;
    return points;
}

}  // namespace

TEST_CASE("Coordinates in a square and points of the photo are inverse to each other") {
    const FaceSquare square{{31.0, 17.0}, {6.0, -2.5}};
    const Eigen::Vector2d at(0.3, -0.8);
    CHECK((square.coordinates(square.point(at)) - at).norm() < 1e-12);
    CHECK((square.point({1.0, 0.0}) - Eigen::Vector2d(37.0, 14.5)).norm() < 1e-12);
    CHECK((square.point({0.0, 1.0}) - Eigen::Vector2d(33.5, 23.0)).norm() < 1e-12);
}

TEST_CASE("The square around points stands on the line of the eyes and holds all of them") {
    const double angle = 0.3;
    const FacePoints points = turned_points(angle);
    const FaceSquare square = square_around(points);
    CHECK(std::atan2(square.axis.y(), square.axis.x()) == Approx(angle));
    double most = 0.0;
    for (const Eigen::Vector2d& point : points)
        most = std::max(most, square.coordinates(point).lpNorm<Eigen::Infinity>());
    CHECK(most == Approx(0.8));  // a margin of a quarter
}

TEST_CASE("Points whose eyes coincide have no square") {
    FacePoints points;
    points.fill({3.0, 4.0});
    CHECK_THROWS_AS(square_around(points), NumericError);
}

TEST_CASE("The image in a square samples a linear photo exactly, and repeats its border") {
    Tensor photo({20, 30, 1});
    const auto values = photo.mutable_values<float>();
    for (std::size_t pixel = 0; pixel < values.size(); ++pixel)
        values[pixel] =
            0.01F * static_cast<float>(pixel % 30) + 0.02F * static_cast<float>(pixel / 30);
    const FaceSquare square{{15.0, 10.0}, {5.0, 2.0}};
    const Tensor image = image_in_square(photo, square, 8);
    for (std::int64_t row = 0; row < 8; ++row)
        for (std::int64_t column = 0; column < 8; ++column) {
            const Eigen::Vector2d at =
                square.point({(static_cast<double>(column) + 0.5) / 4.0 - 1.0,
                              (static_cast<double>(row) + 0.5) / 4.0 - 1.0});
            CHECK(static_cast<double>(
                      image.values<float>()[static_cast<std::size_t>(8 * row + column)]) ==
                  Approx(0.01 * (at.x() - 0.5) + 0.02 * (at.y() - 0.5)).margin(1e-5));
        }
    const Tensor outside = image_in_square(photo, {{-50.0, -50.0}, {5.0, 0.0}}, 2);
    CHECK(outside.values<float>()[0] == values[0]);
    CHECK_THROWS_AS(image_in_square(Tensor::zeros({4, 4}), square, 8), ShapeError);
}

TEST_CASE("what a photo cuts off is seen in the mirror", "[landmarks]") {
    Tensor whole({40, 40, 3});
    const auto values = whole.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto row = static_cast<double>(i / 120), column = static_cast<double>(i / 3 % 40);
        values[i] = static_cast<float>(row + (column - 19.5) * (column - 19.5));
    }
    const Tensor right = image_part(whole, 0, 15, 40, 25);
    const Midline middle{{20.0, 10.0}, {1.0, 0.0}}, moved{{5.0, 10.0}, {1.0, 0.0}};
    const Tensor seen = image_in_square(whole, {{20.0, 20.0}, {15.0, 0.0}}, 30, middle);
    CHECK(seen.to_vector() == image_in_square(whole, {{20.0, 20.0}, {15.0, 0.0}}, 30).to_vector());
    const std::vector<double> completed =
        image_in_square(right, {{5.0, 20.0}, {15.0, 0.0}}, 30, moved).to_vector();
    for (std::size_t i = 0; i < completed.size(); ++i)
        REQUIRE(completed[i] == Approx(seen.to_vector()[i]).margin(1e-4));
    FacePoints points;
    points.fill({3.0, 4.0});
    CHECK_THROWS_AS(midline_of(points), NumericError);
    points[51] = points[57] = {3.0, 9.0};
    CHECK(midline_of(points).mirrored({5.0, 7.0}).isApprox(Eigen::Vector2d(1.0, 7.0)));
}

TEST_CASE("A mirror image swaps the points of the two sides") {
    std::set<std::size_t> partners;
    for (std::size_t k = 0; k < 68; ++k) {
        CHECK(mirrored_point(mirrored_point(k)) == k);
        partners.insert(mirrored_point(k));
    }
    CHECK(partners.size() == 68);
    CHECK(mirrored_point(36) == 45);
    CHECK(mirrored_point(48) == 54);
}
