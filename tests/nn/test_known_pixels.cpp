#include <algorithm>
#include <array>
#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "nn/known_pixels.h"
#include "nn/models/face_batch.h"
#include "support/check_close.h"

namespace known_pixels_tests {

using namespace stymo;
using stymo::test::identical;

namespace {

/// 1 but for a rectangle and a single pixel.
Tensor with_hole(std::int64_t height, std::int64_t width) {
    Tensor known = Tensor::full({height, width, 1}, 1.0);
    const auto values = known.mutable_values<float>();
    for (std::int64_t row = 0; row < height / 3; ++row)
        for (std::int64_t column = width / 2; column < width; ++column)
            values[static_cast<std::size_t>(row * width + column)] = 0.0F;
    values[static_cast<std::size_t>((height - 9) * width + 5)] = 0.0F;
    return known;
}

/// Two photos that agree where pixels are known.
std::array<Tensor, 2> photos(const Tensor& known) {
    const Shape shape = known.shape().with(2, 3);
    const Tensor first = Rng(1).uniform(shape, 0.0, 1.0);
    return {first, where_known(known, first, Rng(2).uniform(shape, 0.0, 1.0)).value()};
}

Tensor resized(const Tensor& image, std::int64_t height, std::int64_t width) {
    const Variable batch = image.reshaped({1, image.shape(0), image.shape(1), image.shape(2)});
    return resize_bicubic(batch, static_cast<int>(height), static_cast<int>(width)).value();
}

Face face_of(const Tensor& image, const Tensor& mask) {
    Face face;
    face.image = image;
    face.mask = mask;
    return face;
}

}  // namespace

TEST_CASE("a mask without unknown pixels is recognised at every size", "[unknown]") {
    // The mean of 71 * 71 ones, and of 570 other squares, is not 1 in float32.
    for (std::int64_t side = 64; side <= 512; ++side) {
        Tensor known = Tensor::full({side, side, 1}, 1.0);
        INFO(side);
        CHECK_FALSE(unless_all_known(known).defined());
        known.mutable_values<float>().back() = 0.0F;
        CHECK(unless_all_known(known).defined());
    }
}

TEST_CASE("a pixel of a resized image is known if it depends on no unknown one", "[unknown]") {
    for (const auto& [height, width] :
         {std::array<std::int64_t, 2>{32, 48}, {16, 16}, {64, 64}, {27, 100}}) {
        const Tensor known = with_hole(64, 48);
        const auto [one, other] = photos(known);
        const Tensor a = resized(one, height, width), b = resized(other, height, width);
        const Tensor at = known_at(known, height, width);
        REQUIRE(at.shape() == Shape{height, width, 1});
        std::size_t differing = 0, claimed = 0;
        for (std::size_t i = 0; i < static_cast<std::size_t>(height * width); ++i) {
            const auto color = [i](const Tensor& image) {
                return image.values<float>().subspan(3 * i, 3);
            };
            const bool same = std::ranges::equal(color(a), color(b));
            const float value = at.values<float>()[i];
            REQUIRE((value == 0.0F || (value == 1.0F && same)));
            differing += same ? 0 : 1;
            claimed += value == 0.0F ? 1 : 0;
        }
        CHECK(claimed == differing);
    }
    CHECK_FALSE(known_at({}, 8, 8).defined());
    CHECK(known_share(with_hole(60, 48)) == Approx(1.0 - 1.0 / 6.0 - 1.0 / 2880.0));
    CHECK_FALSE(unless_all_known(Tensor::full({4, 4, 1}, 1.0)).defined());
}

TEST_CASE("no gradient flows into what is unknown, and none changes without unknown pixels",
          "[unknown]") {
    const Variable x = Variable::leaf(Rng(1).uniform({1, 2, 2, 3}, 0.0, 1.0, DType::float64));
    const std::array<double, 4> numbers{1, 0, 1, 1};
    const Tensor known =
        Tensor::from({1, 2, 2, 1}, std::span<const double>(numbers)).to(DType::float32);
    const Variable seen = where_known(known, x, -1.0);
    CHECK(seen.value().to_vector()[3] == -1.0);
    CHECK(grad(sum(seen), x).value().to_vector() ==
          std::vector<double>{1, 1, 1, 0, 0, 0, 1, 1, 1, 1, 1, 1});
    CHECK(identical(where_known({}, x, -1.0).value(), x.value()));
}

TEST_CASE("what is unknown is guessed from the mirror image, else from known pixels around",
          "[unknown]") {
    Tensor known = Tensor::full({1, 8, 8, 1}, 1.0);
    const auto flags = known.mutable_values<float>();
    const Tensor image = Rng(1).uniform({1, 8, 8, 3}, 0.0, 1.0);
    flags[8] = 0.0F;  // row 1, column 0
    Tensor expected = image;
    std::copy_n(image.values<float>().begin() + 3 * 15, 3,
                expected.mutable_values<float>().begin() + 3 * 8);
    CHECK(identical(with_guesses(known, image), expected));
    // Nothing is known of the upper half: it has the mean of the lower half.
    std::ranges::fill(flags.first(32), 0.0F);
    Tensor halves = Tensor::full({1, 8, 8, 3}, 0.25);
    std::ranges::fill(halves.mutable_values<float>().first(32 * 3), 9.0F);
    CHECK(identical(with_guesses(known, halves), Tensor::full({1, 8, 8, 3}, 0.25)));
    std::ranges::fill(flags, 0.0F);
    CHECK(with_guesses(known, halves).all_finite());
}

TEST_CASE("a batch does not depend on what its photos have in unknown pixels", "[unknown]") {
    const Tensor known = with_hole(128, 128);
    const auto [one, other] = photos(known);
    const Tensor mask = Rng(3).uniform({128, 128, 1}, 0.0, 1.0);
    const auto batch_of = [&](const Tensor& image) {
        const Face whole = face_of(one, mask);
        Face face = face_of(image, mask);
        face.known = known;
        return make_batch(std::array{whole, face, mirrored(face)}, 32);
    };
    const FaceBatch a = batch_of(one), b = batch_of(other);
    CHECK(identical(a.input, b.input));
    CHECK(stymo::test::all_identical(a.targets, b.targets));
    CHECK(identical(a.mask, b.mask));
    CHECK_FALSE(a.known_of(0).defined());
    CHECK(identical(a.known_of(1), known.reshaped({1, 128, 128, 1})));
    CHECK(identical(flip(a.known_of(1), 2).value(), a.known_of(2)));
    // A face without unknown pixels is what it is in a batch of its own.
    const Face whole = face_of(one, mask);
    const FaceBatch alone = make_batch({&whole, 1}, 32);
    CHECK_FALSE(alone.known.defined());
    CHECK(identical(slice(a.input, 0, 0, 1).value(), alone.input));
    for (std::size_t i = 0; i < a.targets.size(); ++i)
        CHECK(identical(slice(a.targets[i], 0, 0, 1).value(), alone.targets[i]));
}

}  // namespace known_pixels_tests
