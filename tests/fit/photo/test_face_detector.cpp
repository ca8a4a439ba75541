#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "fit/photo/face_detector.h"
#include "fit/shipped_files.h"
#include "nn/pretrained/landmark_network.h"
#include "render/parsing_classes.h"
#include "shared_data.h"

using namespace stymo;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

/// The folder of photos with hand-made parsings, if this test can use it.
std::optional<fs::path> photos() {
    if (FaceDetector::available()) return shared_data("data/celebamask");
    std::cout << "skipped: built without dlib\n";
    return std::nullopt;
}

/// The middle of the pixels of one class.
Eigen::Vector2d middle_of(const Tensor& classes, ParsingClass part) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double count = 0.0;
    for (std::int64_t i = 0; i < classes.size(); ++i)
        if (static_cast<int>(classes.values<float>()[static_cast<std::size_t>(i)]) ==
            static_cast<int>(part)) {
            sum[0] += static_cast<double>(i % classes.shape(1)) + 0.5;
            sum[1] += static_cast<double>(i / classes.shape(1)) + 0.5;
            ++count;
        }
    return sum / count;
}

double distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return (a - b).norm();
}

Tensor on_grey(const Tensor& photo, std::int64_t height, std::int64_t width, std::int64_t top,
               std::int64_t left) {
    Tensor canvas = Tensor::full({height, width, 3}, 0.5);
    const auto from = photo.values<float>();
    const auto to = canvas.mutable_values<float>();
    for (std::int64_t row = 0; row < photo.shape(0); ++row)
        std::copy_n(from.begin() + row * photo.shape(1) * 3, photo.shape(1) * 3,
                    to.begin() + ((top + row) * width + left) * 3);
    return canvas;
}

/// Mean distance of the 68 points in parts of the distance of the eyes.
double difference(const Landmarks& found, const Landmarks& expected, double left) {
    double sum = 0.0;
    for (std::size_t k = 0; k < found.size(); ++k)
        sum += distance(found[k] + Eigen::Vector2d(left, 0.0), expected[k]);
    return sum / 68.0 / distance(mean_landmark(expected, 36, 41), mean_landmark(expected, 42, 47));
}

}  // namespace

TEST_CASE("landmarks lie where hand-made parsings have eyes and nose") {
    const auto folder = photos();
    if (!folder) return;
    const FaceDetector detector;
    for (const char* id : {"00001", "00020", "00040"}) {
        const auto faces =
            detector.find(read_image(*folder / "images" / (std::string(id) + ".jpg")));
        REQUIRE(faces.size() == 1);
        const Landmarks& landmarks = faces.front().landmarks;
        const Tensor classes = read_class_map(*folder / "parsing" / (std::string(id) + ".png"));
        const double tolerance = 0.12 * inter_ocular_distance(landmarks);
        // The parsing's left eye is the person's own, on the image's right.
        CHECK(distance(mean_landmark(landmarks, 36, 41),
                       middle_of(classes, ParsingClass::right_eye)) < tolerance);
        CHECK(distance(mean_landmark(landmarks, 42, 47),
                       middle_of(classes, ParsingClass::left_eye)) < tolerance);
        CHECK(std::abs(mean_landmark(landmarks, 27, 35)[0] -
                       middle_of(classes, ParsingClass::nose)[0]) < 2 * tolerance);
    }
}

TEST_CASE(
    "a face is found in a thumbnail, and in a photo of which it is a small part, at the same "
    "place") {
    const auto folder = photos();
    if (!folder) return;
    const FaceDetector detector;
    const Tensor photo = read_image(*folder / "images/00040.jpg");
    const Landmarks landmarks = detector.find(photo).at(0).landmarks;
    const double tolerance = 0.1 * inter_ocular_distance(landmarks);
    const auto largest_difference = [&](const Landmarks& other) {
        double largest = 0.0;
        for (std::size_t i = 17; i < landmarks.size(); ++i)
            largest = std::max(largest, distance(landmarks[i], other[i]));
        return largest;
    };
    const auto in_thumbnail = detector.find(resize_image(photo, 64, 64));
    REQUIRE(in_thumbnail.size() == 1);
    CHECK(largest_difference(scaled_landmarks(in_thumbnail.front().landmarks, 8.0)) <
          2 * tolerance);
    const auto in_large =
        detector.find(on_grey(resize_image(photo, 256, 256), 1500, 2000, 900, 1300));
    REQUIRE(in_large.size() == 1);
    Landmarks moved = in_large.front().landmarks;
    for (Eigen::Vector2d& point : moved) point = {(point[0] - 1300) * 2, (point[1] - 900) * 2};
    CHECK(largest_difference(moved) < tolerance);
}

TEST_CASE("of two faces the larger comes first, and an image without a face has none") {
    const auto folder = photos();
    if (!folder) return;
    const FaceDetector detector;
    const Tensor photo = read_image(*folder / "images/00040.jpg");
    Tensor two = on_grey(photo, 600, 1000, 40, 440);
    const Tensor small = resize_image(photo, 300, 300);
    for (std::int64_t row = 0; row < 300; ++row)
        std::copy_n(small.values<float>().begin() + row * 900, 900,
                    two.mutable_values<float>().begin() + ((150 + row) * 1000 + 60) * 3);
    const auto faces = detector.find(two);
    REQUIRE(faces.size() == 2);
    CHECK(faces[0].width > 1.3 * faces[1].width);
    CHECK(faces[0].left > 440);
    CHECK(detector.find(Tensor::full({100, 80, 3}, 0.5)).empty());
    CHECK_THROWS_AS(detector.find(Tensor::zeros({10, 10, 1})), ShapeError);
}

TEST_CASE("what is no model of landmarks is refused in one line") {
    if (!FaceDetector::available()) {
        CHECK_THROWS_WITH(FaceDetector(), Contains("without dlib"));
        return;
    }
    CHECK_THROWS_WITH(FaceDetector("/nowhere/landmarks.dat"),
                      Contains("/nowhere/landmarks.dat") && Contains("libdlib-data"));
    CHECK_THROWS_WITH(FaceDetector(fs::path(STYMO_SOURCE_DIR) / "README.md"),
                      Contains("not a model"));
    CHECK_THROWS_WITH(FaceDetector("/nowhere/landmarks.safetensors"),
                      Contains("/nowhere/landmarks.safetensors"));
}

TEST_CASE("a landmark network's file takes the place of dlib's model") {
    if (!FaceDetector::available()) return;
    const ScratchFolder folder;
    const fs::path file = folder / "network.safetensors";
    write_landmark_model(file, make_landmark_model(Rng(1)));
    const FaceDetector detector(file);
    CHECK(detector.find(Tensor::full({100, 80, 3}, 0.5)).empty());
}

TEST_CASE("a face of which a photo cuts a third off has the landmarks of the whole one",
          "[landmarks]") {
    const auto shared = shared_data();
    if (!shared || !FaceDetector::available()) return;
    const FaceDetector detector(shipped_landmark_network());
    struct Cut {
        const char* photo;
        std::int64_t left, width;
    };
    for (const auto& [name, left, width] :
         {Cut{"cases/icc/base.png", 0, 315}, Cut{"cases/icc/base.png", 176, 315},
          Cut{"data/portraits/congress/S001156.jpg", 85, 140}}) {
        INFO(name);
        const Tensor photo = read_image(*shared / name);
        const Landmarks whole = detector.find(photo).at(0).landmarks;
        const Tensor part = image_part(photo, 0, left, photo.shape(0), width);
        const Landmarks found = detector.find(part).at(0).landmarks;
        CHECK(difference(found, whole, static_cast<double>(left)) < 0.05);
    }
}

TEST_CASE("a surgical mask covers a mouth, and a bare face nothing", "[landmarks]") {
    const auto shared = shared_data("cases/covered");
    if (!shared || !FaceDetector::available()) return;
    const FaceDetector detector(shipped_landmark_network());
    const FaceCovers bare = detector.find(read_image(*shared / "face.png")).at(0).covers;
    const FaceCovers masked = detector.find(read_image(*shared / "surgical_mask.jpg")).at(0).covers;
    CHECK(bare.mouth < -1.0);
    CHECK(bare.eyes < -1.0);
    CHECK(masked.mouth > 2.0);
    CHECK(masked.eyes < 0.0);
}
