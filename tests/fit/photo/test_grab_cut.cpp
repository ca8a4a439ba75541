#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <numbers>

#include "core/error.h"
#include "core/io/image.h"
#include "core/rng.h"
#include "fit/photo/face_detector.h"
#include "fit/photo/face_parser.h"
#include "fit/photo/grab_cut.h"
#include "fit/photo/head_mask.h"
#include "render/parsing_classes.h"
#include "shared_data.h"

using namespace stymo;

namespace {

constexpr std::int64_t side = 256;

/// Eyes, brows, mouth and the jaw of a face with its eyes at a height of 120 and its chin at 230.
Landmarks drawn_landmarks() {
    Landmarks landmarks;
    landmarks.fill({128.0, 165.0});
    for (std::size_t i = 0; i <= 16; ++i) {
        const double angle = std::numbers::pi * static_cast<double>(i) / 16.0;
        landmarks[i] = {128.0 - 72.0 * std::cos(angle), 120.0 + 110.0 * std::sin(angle)};
    }
    for (std::size_t i = 17; i <= 26; ++i)
        landmarks[i] = {78.0 + 100.0 * static_cast<double>(i - 17) / 9.0, 98.0};
    for (std::size_t i = 36; i <= 41; ++i) landmarks[i] = {98.0, 120.0};
    for (std::size_t i = 42; i <= 47; ++i) landmarks[i] = {158.0, 120.0};
    return landmarks;
}

bool in_ellipse(double x, double y, double center_y, double half_width, double half_height) {
    return std::hypot((x - 128.0) / half_width, (y - center_y) / half_height) < 1.0;
}

struct Drawing {
    Tensor image{Shape{side, side, 3}};
    Tensor head = Tensor::zeros({side, side, 1});
};

/// A face with dark hair, on a neck of the face's own colour, before a light wall.
Drawing drawing() {
    Drawing result;
    Rng random(1);
    const auto pixels = result.image.mutable_values<float>();
    const auto head = result.head.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const double x = static_cast<double>(i % side) + 0.5;
        const double y = static_cast<double>(i / side) + 0.5;
        const bool face = in_ellipse(x, y, 120.0, 72.0, 110.0) && y > 60.0;
        const bool hair = !face && in_ellipse(x, y, 105.0, 92.0, 95.0) && y < 190.0;
        const bool neck = !face && !hair && std::abs(x - 128.0) < 40.0 && y > 190.0;
        std::array<double, 3> color = {0.6, 0.75, 0.85};
        if (face || neck) color = {0.85, 0.65, 0.55};
        if (hair) color = {0.25, 0.15, 0.10};
        for (std::size_t c = 0; c < 3; ++c)
            pixels[static_cast<std::size_t>(i) * 3 + c] =
                static_cast<float>(color[c] + 0.04 * (random.uniform() - 0.5));
        head[static_cast<std::size_t>(i)] = face || hair ? 1.0F : 0.0F;
    }
    return result;
}

}  // namespace

TEST_CASE("GrabCut finds a drawn head with its hair and without its neck") {
    const auto [image, head] = drawing();
    const Tensor mask = grab_cut_head_mask(image, drawn_landmarks());
    CHECK(intersection_over_union(mask, head) > 0.93);
    CHECK(mask.values<float>()[245 * side + 128] == 0.0F);
    CHECK(mask.values<float>()[20 * side + 128] == 1.0F);
    // The colour models begin at random; the mask may not.
    CHECK(intersection_over_union(mask, grab_cut_head_mask(image, drawn_landmarks())) == 1.0);
}

TEST_CASE(
    "GrabCut mends a parser that takes a part of the wall for head and misses a part of the face") {
    const auto [image, head] = drawing();
    Tensor probability = head;
    const auto values = probability.mutable_values<float>();
    for (std::int64_t row = 0; row < 60; ++row)
        for (std::int64_t column = 0; column < 60; ++column) {
            values[static_cast<std::size_t>(row * side + column)] = 0.7F;
            values[static_cast<std::size_t>((row + 110) * side + column + 110)] = 0.2F;
        }
    const double before = intersection_over_union(probability, head);
    const Tensor mask = grab_cut_head_mask(image, drawn_landmarks(),
                                           {.probability = probability, .is_sharp = true});
    CHECK(before < 0.85);
    CHECK(intersection_over_union(mask, head) > 0.95);
}

TEST_CASE("a rough guess of the head does not overrule what the landmarks say") {
    const auto [image, head] = drawing();
    // Blurred by so much that a third of the face is below a half, and the wall above it.
    Tensor guess = Tensor::full({side, side, 1}, 0.6);
    const auto values = guess.mutable_values<float>();
    for (std::int64_t row = 150; row < side; ++row)
        for (std::int64_t column = 0; column < side; ++column)
            values[static_cast<std::size_t>(row * side + column)] = 0.05F;
    const Tensor mask = grab_cut_head_mask(image, drawn_landmarks(), {.probability = guess});
    CHECK(intersection_over_union(guess, head) < 0.5);
    CHECK(intersection_over_union(mask, head) > 0.9);
}

TEST_CASE("GrabCut refuses crops that are not square and landmarks upside down") {
    CHECK_THROWS_AS(grab_cut_head_mask(Tensor::zeros({8, 9, 3}), drawn_landmarks()), ShapeError);
    Landmarks all_at_one_point;
    all_at_one_point.fill({128.0, 165.0});
    CHECK_THROWS_AS(grab_cut_head_mask(Tensor::zeros({8, 8, 3}), all_at_one_point), ValueError);
    CHECK_THROWS_AS(grab_cut_head_mask(Tensor::zeros({8, 8, 3}), drawn_landmarks(),
                                       {.probability = Tensor::zeros({4, 4, 1})}),
                    ShapeError);
}

TEST_CASE("head masks agree with hand-made ones", "[slow]") {
    const auto shared = shared_data();
    if (!shared || !FaceDetector::available()) return;
    const std::filesystem::path photos = *shared / "data/celebamask";
    const FaceDetector detector;
    FaceParser parser(*shared / "weights/face_parser_unet.onnx");
    double by_grab_cut = 0.0, by_parser = 0.0;
    int count = 0;
    for (int i = 1; i < 800; i += 20) {
        const std::string number = std::to_string(i);
        const std::string id = std::string(5 - number.size(), '0') + number;
        const Tensor photo = read_image(photos / "images" / (id + ".jpg"));
        const auto faces = detector.find(photo);
        if (faces.empty()) continue;
        Tensor truth = read_class_map(photos / "parsing" / (id + ".png"));
        for (float& value : truth.mutable_values<float>())
            value = is_head_class(static_cast<int>(value)) ? 1.0F : 0.0F;
        by_grab_cut +=
            intersection_over_union(grab_cut_head_mask(photo, faces.front().landmarks), truth);
        by_parser +=
            intersection_over_union(parser.head_mask(photo, faces.front().landmarks), truth);
        ++count;
    }
    std::cout << "head masks of " << count << " photos: IoU " << by_grab_cut / count
              << " by GrabCut, " << by_parser / count << " by the parser\n";
    CHECK(count >= 38);
    CHECK(by_grab_cut / count >= 0.80);
    CHECK(by_parser / count >= 0.88);
}
