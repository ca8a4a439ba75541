#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/error.h"
#include "core/io/file.h"
#include "fit/photo/alignment.h"
#include "nn/known_pixels.h"

using namespace stymo;

namespace {

/// As in tests/golden/make_alignment_vectors.py.
Tensor formula_image(std::int64_t height, std::int64_t width) {
    Tensor image({height, width, 3});
    std::size_t at = 0;
    const auto values = image.mutable_values<float>();
    for (std::int64_t row = 0; row < height; ++row)
        for (std::int64_t column = 0; column < width; ++column)
            for (std::int64_t channel = 0; channel < 3; ++channel) {
                const auto r = static_cast<double>(row), c = static_cast<double>(column),
                           k = static_cast<double>(channel);
                const double wave =
                    std::sin(0.05 * r + 0.01 * c * (k + 1)) * std::cos(0.03 * c + 0.3 * k);
                values[at++] =
                    static_cast<float>(std::floor(255.0 * (0.5 + 0.45 * wave) + 0.5) / 255.0);
            }
    return image;
}

/// 68 points of which only eyes and mouth corners count.
Landmarks landmarks_at(double x, double y, double interocular, double degrees, double mouth_drop) {
    Landmarks landmarks;
    landmarks.fill(Eigen::Vector2d::Zero());
    const double angle = degrees * std::numbers::pi / 180.0;
    const auto point_at = [&](double right, double down) {
        return Eigen::Vector2d{
            x + interocular * (right * std::cos(angle) - down * std::sin(angle)),
            y + interocular * (right * std::sin(angle) + down * std::cos(angle))};
    };
    for (std::size_t i = 36; i < 42; ++i) landmarks[i] = point_at(-0.5, 0.0);
    for (std::size_t i = 42; i < 48; ++i) landmarks[i] = point_at(0.5, 0.0);
    landmarks[48] = point_at(-0.4, mouth_drop);
    landmarks[54] = point_at(0.4, mouth_drop);
    return landmarks;
}

}  // namespace

TEST_CASE("squares and crops are those of FFHQ's recipe as Pillow and SciPy compute it") {
    const auto cases =
        nlohmann::json::parse(read_file(STYMO_SOURCE_DIR "/tests/golden/alignment_vectors.json"));
    REQUIRE(cases.size() == 4);
    for (const auto& item : cases) {
        // There, the centre of the first pixel is at 0.
        const Landmarks landmarks = landmarks_at(
            item["center"][0].get<double>() + 0.5, item["center"][1].get<double>() + 0.5,
            item["interocular"], item["degrees"], item["mouth_drop"]);
        const Alignment alignment = ffhq_alignment(landmarks);
        CHECK(alignment.center.x() == Approx(item["square"][0].get<double>()));
        CHECK(alignment.center.y() == Approx(item["square"][1].get<double>()));
        CHECK(alignment.axis.x() == Approx(item["square"][2].get<double>()));
        CHECK(alignment.axis.y() == Approx(item["square"][3].get<double>()).margin(1e-9));
        const std::int64_t side = item["side"];
        const Tensor crop =
            aligned_crop(formula_image(item["height"], item["width"]), alignment, side);
        const std::vector<double> expected = item["pixels"];
        REQUIRE(static_cast<std::size_t>(crop.size()) == expected.size());
        double sum = 0.0, largest = 0.0;
        for (std::size_t i = 0; i < expected.size(); ++i) {
            const double difference =
                std::abs(255.0 * static_cast<double>(crop.values<float>()[i]) - expected[i]);
            sum += difference;
            largest = std::max(largest, difference);
        }
        // Pillow's Lanczos filter is not our bicubic one, and it rounds to bytes three times.
        CHECK(sum / static_cast<double>(expected.size()) < 1.5);
        CHECK(largest < 12.0);
    }
}

TEST_CASE("landmarks are carried into the crop: the square's corners become its corners") {
    const Alignment alignment{{120.0, 80.0}, {30.0, 12.0}};
    Landmarks landmarks;
    landmarks.fill(Eigen::Vector2d::Zero());
    landmarks[0] = {120.0 - 30.0 + 12.0, 80.0 - 12.0 - 30.0};
    landmarks[1] = {120.0 + 30.0 - 12.0, 80.0 + 12.0 + 30.0};
    landmarks[2] = {120.0 + 30.0, 80.0 + 12.0};
    const Landmarks moved = aligned_landmarks(landmarks, alignment, 64);
    CHECK(moved[0][0] == Approx(0.0).margin(1e-9));
    CHECK(moved[0][1] == Approx(0.0).margin(1e-9));
    CHECK(moved[1][0] == Approx(64.0));
    CHECK(moved[1][1] == Approx(64.0));
    CHECK(moved[2][0] == Approx(64.0));
    CHECK(moved[2][1] == Approx(32.0));
    CHECK(alignment.side() == Approx(2.0 * std::hypot(30.0, 12.0)));
}

TEST_CASE("the square of a photo that is its own square is the photo") {
    const Tensor image = formula_image(64, 64);
    const Tensor crop = aligned_crop(image, {{32.0, 32.0}, {32.0, 0.0}}, 64);
    // The rim fades, which begins within a border of a tenth of the side.
    for (std::int64_t row = 20; row < 44; ++row)
        for (std::int64_t i = 20 * 3; i < 44 * 3; ++i) {
            const auto at = static_cast<std::size_t>(row * 64 * 3 + i);
            CHECK(crop.values<float>()[at] == Approx(image.values<float>()[at]).margin(0.01));
        }
}

TEST_CASE("the colour of what lies far outside of a photo is its median") {
    Tensor photo = Tensor::full({40, 40, 3}, 0.25);
    const Tensor crop = aligned_crop(photo, {{0.0, 0.0}, {20.0, 0.0}}, 16);
    for (const float value : crop.values<float>()) CHECK(value == Approx(0.25F).margin(1e-4));
    CHECK(share_outside({{0.0, 0.0}, {20.0, 0.0}}, 40, 40) == Approx(0.75));
    CHECK(share_outside({{20.0, 20.0}, {20.0, 0.0}}, 40, 40) == 0.0);
}

TEST_CASE("a pixel of a crop is known if its surroundings lie on known pixels of the photo",
          "[unknown]") {
    const Alignment whole{{50, 50}, {32, 0}};  // pixels 18 to 82 of a photo
    CHECK_FALSE(known_crop(whole, 64, 100, 100).defined());
    const auto row_of = [](const Tensor& known) {
        const auto values = known.values<float>();
        return std::vector<float>(values.begin() + 16 * 32, values.begin() + 17 * 32);
    };
    const auto first_known = [&](const Tensor& known) {
        const std::vector<float> row = row_of(known);
        return std::ranges::find(row, 1.0F) - row.begin();
    };
    // A pixel of the crop has two of the photo. The left border of the photo is at pixel 5 of the
    // crop, and half a pixel more must be within it.
    const Alignment beyond{{22, 50}, {32, 0}};
    CHECK(first_known(known_crop(beyond, 32, 100, 100)) == 6);
    Tensor ignored = Tensor::full({100, 100, 1}, 1.0);
    ignored.mutable_values<float>()[50 * 100 + 30] = 0.0F;
    const std::vector<float> row = row_of(known_crop(whole, 32, 100, 100, ignored));
    // Pixel 30 of the photo is the left half of pixel 6 of the crop.
    for (std::size_t i = 0; i < row.size(); ++i) CHECK(row[i] == (i == 5 || i == 6 ? 0.0F : 1.0F));
    // Half of a square that is turned by 45 degrees lies outside.
    const Alignment turned{{0, 50}, {16, 16}};
    CHECK(known_share(known_crop(turned, 128, 100, 100)) == Approx(0.5).margin(0.02));
    CHECK(known_share(known_crop(turned, 128, 100, 100)) < 0.5);
}

TEST_CASE("only a photo that is nearly the square counts as aligned") {
    CHECK(is_aligned({{256.0, 260.0}, {250.0, 2.0}}, 512, 512));
    CHECK_FALSE(is_aligned({{256.0, 260.0}, {170.0, 2.0}}, 512, 512));
    CHECK_FALSE(is_aligned({{256.0, 300.0}, {250.0, 2.0}}, 512, 512));
    CHECK_FALSE(is_aligned({{256.0, 256.0}, {250.0, 60.0}}, 512, 512));
    CHECK_FALSE(is_aligned({{256.0, 260.0}, {250.0, 2.0}}, 512, 513));
}

TEST_CASE("landmarks without extent are refused") {
    Landmarks landmarks;
    landmarks.fill(Eigen::Vector2d::Zero());
    CHECK_THROWS_AS(ffhq_alignment(landmarks), NumericError);
    CHECK_THROWS_AS(aligned_crop(Tensor::zeros({4, 4, 3}), {{2.0, 2.0}, {2.0, 0.0}}, 0),
                    ShapeError);
}
