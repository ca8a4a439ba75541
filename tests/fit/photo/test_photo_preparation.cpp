#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/io/image.h"
#include "core/rng.h"
#include "fit/photo/face_detector.h"
#include "fit/photo/head_mask.h"
#include "fit/photo/photo_preparation.h"
#include "nn/known_pixels.h"
#include "render/morphable/builtin_head.h"
#include "support/error_message.h"
#include "train/data/synthetic_faces.h"

using namespace stymo;

namespace {

constexpr double degree = std::numbers::pi / 180.0;

struct RenderedHead {
    SyntheticFace face;
    SyntheticImage image;
};

RenderedHead rendered_head(std::uint64_t seed, std::int64_t side) {
    const MorphableHead head = builtin_head();
    RenderedHead rendered{sample_synthetic_face(head, Rng(seed)), {}};
    rendered.image = render_synthetic_face(head, rendered.face, {}, side);
    return rendered;
}

/// The image with black around it, landmarks moved along.
RenderedHead with_margin(RenderedHead rendered, std::int64_t margin) {
    const auto widened = [&](const Tensor& from) {
        const std::int64_t side = from.shape(0), channels = from.shape(2),
                           width = side + 2 * margin;
        Tensor to = Tensor::zeros({width, width, channels});
        for (std::int64_t row = 0; row < side; ++row)
            std::copy_n(
                from.values<float>().begin() + row * side * channels, side * channels,
                to.mutable_values<float>().begin() + ((row + margin) * width + margin) * channels);
        return to;
    };
    rendered.image.color = widened(rendered.image.color);
    rendered.image.mask = widened(rendered.image.mask);
    for (auto& point : rendered.image.landmarks)
        for (double& coordinate : point) coordinate += static_cast<double>(margin);
    return rendered;
}

}  // namespace

TEST_CASE("a rendered head with known landmarks and mask is aligned, and its turn is found",
          "[photo]") {
    const RenderedHead rendered = with_margin(rendered_head(5, 256), 100);
    PhotoPreparationSettings settings;
    settings.side = 128;
    const PhotoPreparation preparation(settings);
    std::vector<FaceCrop> crops =
        preparation.crops(rendered.image.color, {rendered.image.mask, rendered.image.landmarks});
    REQUIRE(crops.size() == 1);
    const FaceCrop& crop = crops.front();
    CHECK(crop.image.shape() == Shape{128, 128, 3});
    CHECK(crop.mask.shape() == Shape{128, 128, 1});
    CHECK_FALSE(crop.was_aligned);
    CHECK_FALSE(crop.made_mask);
    CHECK_FALSE(crop.mask_agreement);
    // FFHQ has the eyes in the middle of the width, a little above that of the height.
    const Eigen::Vector2d eyes = mean_landmark(crop.landmarks, 36, 47);
    CHECK(eyes[0] == Approx(64.0).margin(6.0));
    CHECK(eyes[1] == Approx(60.0).margin(6.0));
    const std::vector<PreparedFace> faces = preparation.finish(std::move(crops));
    REQUIRE(faces.size() == 1);
    CHECK(faces[0].failure.empty());
    CHECK(std::abs(faces[0].fit.pose.yaw - rendered.face.pose.yaw) < 3 * degree);
    CHECK(faces[0].fit.landmark_error < 0.015);
    CHECK(faces[0].fit.identity.size() == 100);
}

TEST_CASE("a head that leaves FFHQ's square is cut out whole where that is asked for", "[photo]") {
    // A head from the side, drawn with a wide lens, so that all of it is in the photo.
    const MorphableHead head = builtin_head();
    RenderedHead turned{sample_synthetic_face(head, Rng(5)), {}};
    turned.face.pose = orbit_pose(55.0 * degree, 0.0, 0.0, 5.3);
    turned.image = render_synthetic_face(head, turned.face, {.focal = 1.2}, 512);
    const RenderedHead photo = with_margin(std::move(turned), 100);
    const KnownOfPhoto known{photo.image.mask, photo.image.landmarks};
    PhotoPreparationSettings settings;
    settings.side = 128;
    const FaceCrop narrow = PhotoPreparation(settings).crops(photo.image.color, known).front();
    settings.whole_head = true;
    const FaceCrop wide = PhotoPreparation(settings).crops(photo.image.color, known).front();
    const auto at_the_sides = [](const FaceCrop& crop) {
        double sum = 0.0;
        for (std::int64_t row = 0; row < 128; ++row)
            for (const std::int64_t column : {std::int64_t{0}, std::int64_t{127}})
                sum += crop.mask.values<float>()[static_cast<std::size_t>(row * 128 + column)];
        return sum;
    };
    CHECK(at_the_sides(narrow) > 10.0);
    CHECK(at_the_sides(wide) < 3.0);
    const double scale = wide.side_in_photo / narrow.side_in_photo;
    CHECK(scale > 1.1);
    CHECK(scale < 1.51);
    // The same points of the photo: distances shrink, the middle stays.
    for (std::size_t i = 0; i < wide.landmarks.size(); ++i) {
        const Eigen::Vector2d middle(64.0, 64.0);
        CHECK((middle + (narrow.landmarks[i] - middle) / scale - wide.landmarks[i]).norm() < 0.01);
    }
}

TEST_CASE("masks that are made are compared with known ones, and need a network", "[photo]") {
    const RenderedHead rendered = rendered_head(6, 256);
    PhotoPreparationSettings settings;
    settings.side = 64;
    settings.new_masks = true;
    const KnownOfPhoto known{rendered.image.mask, rendered.image.landmarks};
    const auto crop = [&] {
        return PhotoPreparation(settings).crops(rendered.image.color, known).front();
    };
    CHECK(test::error_message<ValueError>([&] { static_cast<void>(crop()); }) ==
          "its head mask is not known, and no head-mask network lies beside this program; name one "
          "with --mask-net");
    settings.mask_network = STYMO_SOURCE_DIR "/configs/models/head-mask/network.safetensors";
    const FaceCrop made = crop();
    CHECK(made.made_mask);
    REQUIRE(made.mask_agreement);
    CHECK(*made.mask_agreement > 0.7);
}

TEST_CASE("what lies outside a photo, or is said to be covered, is unknown in the crop",
          "[photo]") {
    const RenderedHead rendered = with_margin(rendered_head(5, 256), 100);
    PhotoPreparationSettings settings;
    settings.side = 64;
    const PhotoPreparation preparation(settings);
    const Tensor& mask = rendered.image.mask;
    const auto crop = [&](const Tensor& photo, const Tensor& known) {
        return preparation
            .crops(photo, {image_part(mask, 0, 0, photo.shape(0), photo.shape(1)),
                           rendered.image.landmarks, known})
            .front();
    };
    CHECK_FALSE(crop(rendered.image.color, {}).known.defined());
    const Tensor cut = image_part(rendered.image.color, 0, 0, 256, 456);
    const FaceCrop lower = crop(cut, {});
    CHECK(known_share(lower.known) == Approx(1.0 - lower.share_outside).margin(0.06));
    CHECK(known_share(lower.known) < 1.0 - lower.share_outside);
    // A mask of half the photo's size is read in the photo's frame.
    Tensor half = Tensor::full({228, 228, 1}, 1.0);
    std::ranges::fill(half.mutable_values<float>().subspan(128 * 228), 0.0F);
    const FaceCrop covered = crop(rendered.image.color, half);
    CHECK(known_share(covered.known) == Approx(known_share(lower.known)).margin(0.04));
    CHECK(covered.fit_target.mask.values<float>().back() == 0.0F);
    CHECK(test::error_message<ValueError>([&] {
              static_cast<void>(crop(rendered.image.color, Tensor::zeros({228, 100, 1})));
          }) == "its mask has 100 x 228 pixels, which are other proportions than 456 x 456");
}

TEST_CASE("a photo without a face, or with a mask of other proportions, is refused with the reason",
          "[photo]") {
    const PhotoPreparation preparation{PhotoPreparationSettings{}};
    const RenderedHead rendered = rendered_head(5, 64);
    const KnownOfPhoto wrong{Tensor::full({64, 80, 1}, 1.0), rendered.image.landmarks};
    CHECK(test::error_message<ValueError>([&] {
              static_cast<void>(preparation.crops(rendered.image.color, wrong));
          }) == "its mask has 80 x 64 pixels, which are other proportions than 64 x 64");
    if (!FaceDetector::available()) return;
    const Tensor grey = Tensor::full({80, 100, 3}, 0.5);
    CHECK(test::error_message<ValueError>(
              [&] { static_cast<void>(preparation.crops(grey, {})); }) == "no face was found");
}

TEST_CASE("a photo on its side is turned, and a face is chosen from the left", "[photo][slow]") {
    if (!FaceDetector::available()) return;
    PhotoPreparationSettings settings;
    settings.side = 64;
    settings.mask_network = STYMO_SOURCE_DIR "/configs/models/head-mask/network.safetensors";
    const Tensor left = with_margin(rendered_head(5, 256), 100).image.color;
    const Tensor right = with_margin(rendered_head(6, 320), 68).image.color;
    const Tensor both = tile_images({left, right}, 2);
    const auto prepared = [&](const Tensor& photo, std::int64_t face) {
        settings.face = face;
        const PhotoPreparation preparation(settings);
        return preparation.finish(preparation.crops(photo, {})).front();
    };
    const PreparedFace upright = prepared(left, 0);
    CHECK(upright.crop.quarter_turns == 0);
    for (const int turns : {1, 2, 3}) {
        const PreparedFace turned = prepared(turned_image(left, turns), 0);
        CHECK(turned.crop.quarter_turns == 4 - turns);
        CHECK(std::ranges::equal(turned.crop.image.values<float>(),
                                 upright.crop.image.values<float>()));
        CHECK(std::ranges::any_of(turned.warnings, [](const std::string& warning) {
            return warning.starts_with("the face did not stand upright");
        }));
    }
    const auto difference = [](const Tensor& a, const Tensor& b) {
        double sum = 0.0;
        for (std::size_t i = 0; i < a.values<float>().size(); ++i)
            sum += std::abs(a.values<float>()[i] - b.values<float>()[i]);
        return sum / static_cast<double>(a.size());
    };
    const Tensor alone = prepared(right, 0).crop.image;
    CHECK(difference(prepared(both, 0).crop.image, alone) < 0.03);
    CHECK(difference(prepared(both, 2).crop.image, alone) < 0.03);
    CHECK(difference(prepared(both, 1).crop.image, upright.crop.image) < 0.03);
    CHECK(difference(alone, upright.crop.image) > 0.05);
    CHECK(test::error_message<ValueError>([&] { static_cast<void>(prepared(both, 3)); }) ==
          "has 2 faces, no face 3 from the left");
}

TEST_CASE("a face of few pixels, points that are no face, and a profile are refused",
          "[photo][slow]") {
    PhotoPreparationSettings settings;
    settings.side = 256;
    const PhotoPreparation preparation(settings);
    const auto failure_of = [&](const RenderedHead& photo) {
        return preparation
            .finish(preparation.crops(photo.image.color, {photo.image.mask, photo.image.landmarks}))
            .front()
            .failure;
    };
    CHECK(failure_of(with_margin(rendered_head(5, 256), 100)).empty());
    CHECK_THAT(failure_of(with_margin(rendered_head(5, 40), 100)),
               Catch::StartsWith("its face is too small (a crop of ") &&
                   Catch::EndsWith("needed); use a larger photo"));
    RenderedHead beside = with_margin(rendered_head(5, 256), 100);
    for (auto& point : beside.image.landmarks) point[0] += 1e5;
    CHECK(failure_of(beside) ==
          "its face is cut off (100 percent of the crop lie outside the photo)");
    RenderedHead far = with_margin(rendered_head(5, 256), 100);
    for (auto& point : far.image.landmarks) point += Eigen::Vector2d(1e7, 1e7);
    CHECK(failure_of(far) == "its face is cut off (100 percent of the crop lie outside the photo)");
    const RenderedHead covered = with_margin(rendered_head(5, 256), 100);
    const Tensor nothing = Tensor::zeros({456, 456, 1});
    CHECK(preparation
              .finish(preparation.crops(covered.image.color, {.mask = covered.image.mask,
                                                              .landmarks = covered.image.landmarks,
                                                              .known = nothing}))
              .front()
              .failure == "too little of its face is known");
    RenderedHead upside_down = rendered_head(5, 256);
    std::ranges::reverse(upside_down.image.landmarks);
    CHECK(failure_of(upside_down) == "the head model does not fit what was found");

    if (!FaceDetector::available()) return;
    const MorphableHead head = builtin_head();
    SyntheticFace profile = sample_synthetic_face(head, Rng(5));
    profile.pose = orbit_pose(85.0 * degree, 0.0, 0.0, 5.3);
    const Tensor photo = render_synthetic_face(head, profile, {}, 256).color;
    CHECK(test::error_message<ValueError>(
              [&] { static_cast<void>(preparation.crops(photo, {})); }) == "no face was found");
}
