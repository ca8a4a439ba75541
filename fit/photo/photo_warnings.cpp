#include "fit/photo/photo_warnings.h"

#include <cmath>
#include <sstream>

#include "core/angle.h"

namespace stymo {
namespace {

constexpr double largest_share_outside = 0.10;
/// Fits of true profiles end between 45 and 60 degrees.
constexpr double largest_yaw_deg = 45.0;
constexpr double least_covered = 0.05;
constexpr double most_covered = 0.95;
constexpr double doubtful_landmark_error = 0.04;
/// A crop with fewer pixels per wanted pixel is blurred.
constexpr double coarse_resolution = 0.5;
/// See PhotoLook.
constexpr double surely_covered = 2.0;
constexpr double in_head = 0.5;
constexpr double dark = 0.36;
constexpr double noisy = 0.03;
constexpr double largest_clipped_share = 0.25;

template <class... Parts>
std::string line(const Parts&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    return text.str();
}

long percent(double share) {
    return std::lround(100.0 * share);
}

}  // namespace

std::vector<std::string> photo_warnings(const PhotoFindings& findings) {
    std::vector<std::string> warnings;
    if (findings.faces > 1)
        warnings.push_back(line(findings.faces,
                                " faces were found and the clearest one is used; take another one "
                                "with stymo-fit --face N, counted from the left, or Face in the "
                                "viewer, or all with stymo-prep --all-faces"));
    if (findings.quarter_turns != 0)
        warnings.push_back(line("the face did not stand upright; the photo was turned by ",
                                90 * findings.quarter_turns, " degrees clockwise"));
    if (findings.crop_side < coarse_resolution * static_cast<double>(findings.wanted_side))
        warnings.push_back(line("the head is small: its crop has ", std::lround(findings.crop_side),
                                " pixels per side, but ", findings.wanted_side,
                                " are wanted; use a larger photo"));
    if (findings.share_outside > largest_share_outside)
        warnings.push_back(line("the head is cut off: ", percent(findings.share_outside),
                                " percent of the crop lie outside the photo, where the model alone "
                                "decides; use a photo with more space around the head"));
    const bool is_profile = std::abs(degrees_from_radians(findings.yaw)) > largest_yaw_deg;
    if (is_profile)
        warnings.push_back(line(
            "the head is turned by ", std::lround(degrees_from_radians(findings.yaw)),
            " degrees or more, and half of the face is hidden, so its pose may be wrong; use a "
            "photo from nearer the front"));
    if (findings.covered_share < least_covered || findings.covered_share > most_covered)
        warnings.push_back(line("the head mask covers ", percent(findings.covered_share),
                                " percent of the image; give ",
                                findings.made_mask ? "a mask" : "another mask"));
    if (findings.landmark_error > doubtful_landmark_error)
        warnings.push_back(
            line("the landmark error of the head model is ", percent(findings.landmark_error),
                 " percent of the image's side; the pose may be wrong, look at the overlay"));
    const PhotoLook& look = findings.look;
    constexpr const char* ignore =
        "; if something covers them, leave it out with stymo-fit --ignore, or Covered in the "
        "viewer";
    // Of a profile the far half is hidden, not covered.
    if (!is_profile && (look.covers.mouth > surely_covered || look.mouth_in_mask < in_head))
        warnings.push_back(line("mouth and chin do not look like the rest of the face", ignore));
    if (!is_profile && (look.covers.eyes > surely_covered || look.eyes_in_mask < in_head))
        warnings.push_back(line("the eyes do not look like the rest of the face", ignore));
    if (look.brightness < dark)
        warnings.push_back(line("the photo is dark (its brightest parts reach ",
                                percent(look.brightness),
                                " percent), so noise is fitted and scores say little; use a "
                                "brighter photo"));
    if (look.noise > noisy)
        warnings.push_back(line("the photo is noisy (by ", percent(look.noise),
                                " percent of the face's brightness), and the noise is fitted; use "
                                "a photo with more light"));
    if (look.clipped > largest_clipped_share)
        warnings.push_back(line("the light clips ", percent(look.clipped),
                                " percent of the face, where its colours are lost; use a photo "
                                "with another exposure"));
    return warnings;
}

}  // namespace stymo
