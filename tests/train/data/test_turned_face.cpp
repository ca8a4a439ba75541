#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/rng.h"
#include "nn/known_pixels.h"
#include "render/morphable/builtin_head.h"
#include "render/spherical_harmonics.h"
#include "train/data/synthetic_faces.h"
#include "train/data/turned_face.h"

namespace turned_face_tests {

using namespace stymo;

namespace {

constexpr std::int64_t side = 128;

SyntheticFace head_of(const Pose& pose) {
    SyntheticFace head = sample_synthetic_face(builtin_head(), Rng(5));
    head.pose = pose;
    // The same light from all sides, so that a point has one colour in every view.
    const auto light = neutral_light();
    head.light.assign(light.begin(), light.end());
    return head;
}

SyntheticImage rendering_from(const Pose& pose) {
    return render_synthetic_face(builtin_head(), head_of(pose), {}, side);
}

Pose seen_from(double yaw) {
    return orbit_pose(yaw, 0.0, 0.0, 5.3);
}

/// A rendered head as a photo, with its exact code and pose.
Face photo_from(const Pose& pose) {
    const SyntheticFace head = head_of(pose);
    const SyntheticImage image = rendering_from(pose);
    Face face;
    face.id = "a";
    face.image = image.color;
    face.mask = image.mask;
    face.pose = pose;
    face.code = head.identity;
    face.code.insert(face.code.end(), head.expression.begin(), head.expression.end());
    face.code.resize(306, 0.0F);
    face.has_mask = face.has_pose = face.has_code = true;
    return face;
}

/// Mean difference of the face's pixels to the head itself, rendered from there.
double error_of(const Face& turned) {
    const Tensor truth = rendering_from(turned.pose).color;
    double sum = 0.0, count = 0.0;
    for (std::int64_t i = 0; i < 3 * side * side; ++i) {
        const auto pixel = static_cast<std::size_t>(i / 3), value = static_cast<std::size_t>(i);
        if (turned.mask.values<float>()[pixel] == 0.0F) continue;
        sum += std::abs(turned.image.values<float>()[value] - truth.values<float>()[value]);
        count += 1.0;
    }
    return sum / count;
}

/// Shares of the image that are known not to be the face, and of these that show the head.
struct Background {
    double share = 0.0, wrong = 0.0;
};

Background background_of(const Face& turned) {
    const Tensor truth = rendering_from(turned.pose).mask;
    Background background;
    for (std::size_t i = 0; i < truth.values<float>().size(); ++i) {
        if (turned.known.values<float>()[i] == 0.0F || turned.mask.values<float>()[i] > 0.0F)
            continue;
        background.share += 1.0 / static_cast<double>(side * side);
        if (truth.values<float>()[i] > 0.0F)
            background.wrong += 1.0 / static_cast<double>(side * side);
    }
    return background;
}

}  // namespace

TEST_CASE("a turned face looks like the head from there", "[turned_face]") {
    const Face photo = photo_from(seen_from(0.05));
    for (const double yaw : {-0.6, -0.3, 0.0, 0.3, 0.6}) {
        const auto turned = turned_face(photo, builtin_head(), yaw, 0.1);
        REQUIRE(turned);
        CHECK(turned->pose.yaw == Approx(0.05 + yaw).margin(0.03));
        CHECK(error_of(*turned) < 0.006);
        const double shown = known_share(turned->mask);
        CHECK(shown > (std::abs(yaw) < 0.5 ? 0.08 : 0.04));
        CHECK(shown < 0.3);
        CHECK(turned->id == photo.id);
        CHECK(turned->code == photo.code);
        const auto [least, most] = std::ranges::minmax(turned->image.values<float>());
        CHECK(least >= 0.0F);
        CHECK(most <= 1.0F);
        const Background background = background_of(*turned);
        CHECK(background.share > 0.1);
        CHECK(background.wrong < 0.005 * background.share);
    }
    // The photo in the turned face's place is another picture.
    Face unmoved = *turned_face(photo, builtin_head(), 0.6, 0.0);
    unmoved.image = photo.image;
    CHECK(error_of(unmoved) > 0.03);
}

TEST_CASE("a turned face knows nothing that its photo does not show", "[turned_face]") {
    Face photo = photo_from(seen_from(0.6));
    // From the other side the nose hides no cheek, but in the photo it did.
    const auto back = turned_face(photo, builtin_head(), -0.7, 0.0);
    REQUIRE(back);
    CHECK(error_of(*back) < 0.006);
    const auto nearly = turned_face(photo_from(seen_from(-0.1)), builtin_head(), 0.0, 0.0);
    CHECK(known_share(back->mask) < 0.9 * known_share(nearly->mask));

    photo.known = Tensor::full({side, side, 1}, 1.0);
    for (std::int64_t i = 0; i < side * side / 2; ++i)
        photo.known.mutable_values<float>()[static_cast<std::size_t>(i)] = 0.0F;
    const auto lower = turned_face(photo, builtin_head(), -0.2, 0.0);
    REQUIRE(lower);
    CHECK(known_share(lower->mask) <
          0.8 * known_share(
                    turned_face(photo_from(seen_from(0.6)), builtin_head(), -0.2, 0.0)->mask));
}

TEST_CASE("a face without what turning needs is not turned", "[turned_face]") {
    const Face photo = photo_from(seen_from(0.0));
    CHECK_FALSE(turned_face(mirrored(photo), builtin_head(), 0.2, 0.0));
    CHECK_FALSE(turned_face(photo, builtin_head(), 2.5, 0.0));
    Face other = photo;
    other.has_code = false;
    CHECK_FALSE(turned_face(other, builtin_head(), 0.2, 0.0));
    other = photo;
    other.has_pose = false;
    CHECK_FALSE(turned_face(other, builtin_head(), 0.2, 0.0));
    other = photo;
    other.mask = Tensor::zeros(photo.mask.shape());
    CHECK_FALSE(turned_face(other, builtin_head(), 0.2, 0.0));
}

}  // namespace turned_face_tests
