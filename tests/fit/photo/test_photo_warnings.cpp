#include <catch2/catch.hpp>

#include "fit/photo/photo_warnings.h"
#include "support/error_message.h"

using namespace stymo;

namespace {

PhotoFindings good() {
    return {.crop_side = 600.0, .wanted_side = 512, .landmark_error = 0.01};
}

void check_only(const PhotoFindings& findings, const std::string& text) {
    const std::vector<std::string> warnings = photo_warnings(findings);
    REQUIRE(warnings.size() == 1);
    CHECK_THAT(warnings.front(), Catch::Contains(text));
    CHECK(test::is_one_line(warnings.front()));
}

}  // namespace

TEST_CASE("a good photo is not warned of", "[photo]") {
    CHECK(photo_warnings(good()).empty());
}

TEST_CASE("each thing that looks wrong has a warning of its own", "[photo]") {
    PhotoFindings several = good();
    several.faces = 3;
    check_only(several, "3 faces were found");
    PhotoFindings on_its_side = good();
    on_its_side.quarter_turns = 3;
    check_only(on_its_side, "the photo was turned by 270 degrees clockwise");
    PhotoFindings small = good();
    small.crop_side = 100.0;
    check_only(small, "100 pixels per side, but 512 are wanted");
    PhotoFindings cut = good();
    cut.share_outside = 0.2;
    check_only(cut, "20 percent of the crop lie outside");
    PhotoFindings turned = good();
    turned.yaw = -1.2;
    check_only(turned, "turned by -69 degrees");
    turned.yaw = 0.82;
    turned.look.covers.eyes = turned.look.covers.mouth = 2.5;  // the far half
    check_only(turned, "turned by 47 degrees or more");
    PhotoFindings empty = good();
    empty.covered_share = 0.04;
    check_only(empty, "give a mask");
    PhotoFindings full = good();
    full.covered_share = 0.96;
    full.made_mask = false;
    check_only(full, "covers 96 percent of the image; give another mask");
    PhotoFindings astray = good();
    astray.landmark_error = 0.06;
    check_only(astray, "look at the overlay");
    PhotoFindings masked = good();
    masked.look.covers.mouth = 2.5;
    check_only(masked, "mouth and chin do not look like the rest of the face");
    PhotoFindings shaded = good();
    shaded.look.covers.eyes = 2.5;
    check_only(shaded, "the eyes do not look like the rest of the face");
    PhotoFindings cloth = good();
    cloth.look.mouth_in_mask = 0.2;
    check_only(cloth, "mouth and chin do not look like the rest of the face");
    PhotoFindings patch = good();
    patch.look.eyes_in_mask = 0.2;
    check_only(patch, "the eyes do not look like the rest of the face");
    PhotoFindings dark = good();
    dark.look.brightness = 0.3;
    check_only(dark, "its brightest parts reach 30 percent");
    PhotoFindings noisy = good();
    noisy.look.noise = 0.05;
    check_only(noisy, "noisy (by 5 percent of the face's brightness)");
    PhotoFindings clipped = good();
    clipped.look.clipped = 0.4;
    check_only(clipped, "clips 40 percent of the face");
}
