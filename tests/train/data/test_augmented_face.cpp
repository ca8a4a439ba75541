#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/rng.h"
#include "nn/known_pixels.h"
#include "support/check_close.h"
#include "train/data/augmented_face.h"

namespace augmented_face_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t side = 64;

double disc(double x, double y) {
    return std::clamp(2.5 - 0.1 * std::hypot(x - 30.0, y - 34.0), 0.0, 1.0);
}

/// A photo whose red and green are each pixel's coordinates and whose mask is a soft disc.
Face ramp() {
    Face face;
    face.id = "a";
    face.image = Tensor({side, side, 3});
    face.mask = Tensor({side, side, 1});
    for (std::int64_t i = 0; i < side * side; ++i) {
        const double x = static_cast<double>(i % side), y = static_cast<double>(i / side);
        float* const color = face.image.mutable_values<float>().data() + 3 * i;
        color[0] = static_cast<float>(x / side);
        color[1] = static_cast<float>(y / side);
        face.mask.mutable_values<float>()[static_cast<std::size_t>(i)] =
            static_cast<float>(disc(x, y));
    }
    face.code.assign(306, 0.5F);
    face.has_code = face.has_mask = face.has_pose = true;
    return face;
}

/// The pixel of the ramp that a pixel of another picture of it shows.
std::array<double, 2> source_of(const Face& face, std::int64_t pixel) {
    const float* const color = face.image.values<float>().data() + 3 * pixel;
    return {static_cast<double>(color[0]) * side, static_cast<double>(color[1]) * side};
}

}  // namespace

TEST_CASE("a bent face moves image, mask and known pixels alike", "[augmented_face]") {
    const Face photo = ramp();
    double sum = 0.0, count = 0.0, unknown = 0.0, worst = 0.0;
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
        const Face face = bent(photo, Rng(seed));
        CHECK(face.code == photo.code);
        for (std::int64_t i = 0; i < side * side; ++i) {
            const auto pixel = static_cast<std::size_t>(i);
            if (face.known.values<float>()[pixel] == 0.0F) {
                unknown += 1.0;
                continue;
            }
            const auto [x, y] = source_of(face, i);
            // Near the rim cubic interpolation of a ramp repeats the last value.
            if (std::min({x, y, side - 1.0 - x, side - 1.0 - y}) < 2.0) continue;
            // At the two ends of its edge the disc is not linear: a third of a pixel.
            worst = std::max(worst, std::abs(face.mask.values<float>()[pixel] - disc(x, y)));
            const double dx = x - static_cast<double>(i % side),
                         dy = y - static_cast<double>(i / side);
            sum += dx * dx + dy * dy;
            count += 2.0;
        }
    }
    CHECK(worst < 0.03);
    // The points' deviation is about 1 pixel; stretching adds 5 percent of the distance from the
    // middle, whose mean square is a twelfth of the side's.
    const double deviation = std::sqrt(sum / count) / side;
    CHECK(deviation > 0.012);
    CHECK(deviation < 0.024);
    CHECK(unknown > 0.0);
    CHECK(unknown / (40.0 * side * side) < 0.08);
    CHECK(identical(bent(photo, Rng(3)).image, bent(photo, Rng(3)).image));
    CHECK_FALSE(identical(bent(photo, Rng(3)).image, bent(photo, Rng(4)).image));
}

TEST_CASE("a bent face shows nothing unknown as known", "[augmented_face]") {
    Face photo = ramp();
    photo.known = Tensor::full({side, side, 1}, 1.0);
    for (std::int64_t i = 0; i < side * side; ++i)
        if (i % side < 32) photo.known.mutable_values<float>()[static_cast<std::size_t>(i)] = 0.0F;
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
        const Face face = bent(photo, Rng(seed));
        CHECK(known_share(face.known) > 0.35);
        double least = side;
        for (std::int64_t i = 0; i < side * side; ++i)
            if (face.known.values<float>()[static_cast<std::size_t>(i)] > 0.0F)
                least = std::min(least, source_of(face, i)[0]);
        CHECK(least > 31.9);
    }
}

TEST_CASE("a recoloured face has its colours changed, the same for all pixels",
          "[augmented_face]") {
    Face photo = ramp();
    photo.image = Rng(9).split("image").uniform({side, side, 3}, 0.2, 0.6);
    std::copy_n(photo.image.values<float>().begin(), 3,
                photo.image.mutable_values<float>().end() - 3);
    double change = 0.0;
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
        const Face face = recolored(photo, Rng(seed));
        CHECK(identical(face.mask, photo.mask));
        CHECK_FALSE(face.known.defined());
        CHECK(face.code == photo.code);
        const std::span<const float> from = photo.image.values<float>();
        const std::span<const float> to = face.image.values<float>();
        CHECK(std::equal(to.begin(), to.begin() + 3, to.end() - 3));
        CHECK(std::ranges::min(to) >= 0.0F);
        CHECK(std::ranges::max(to) <= 1.0F);
        for (std::size_t i = 0; i < to.size(); ++i) {
            const double ratio = std::log(std::max(to[i], 1e-3F) / from[i]);
            change += ratio * ratio / static_cast<double>(to.size() * 40);
        }
    }
    // Power 0.2 * log(0.4), factor, brightness, and what saturation does to random colours.
    CHECK(std::sqrt(change) > 0.15);
    CHECK(std::sqrt(change) < 0.3);
    CHECK(identical(recolored(photo, Rng(3)).image, recolored(photo, Rng(3)).image));
}

}  // namespace augmented_face_tests
