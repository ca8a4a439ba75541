#include "fit/photo/photo_warnings.h"

#include <cmath>
#include <sstream>

#include "core/angle.h"

namespace stymo {
namespace {

constexpr double largest_share_outside = 0.10;
constexpr double largest_yaw_deg = 60.0;
constexpr double least_covered = 0.05;
constexpr double most_covered = 0.95;
constexpr double doubtful_landmark_error = 0.04;
/// A crop with fewer pixels per wanted pixel is blurred.
constexpr double coarse_resolution = 0.5;
/// See PhotoLook.
constexpr double covered_difference = 0.3;
constexpr double dark = 0.36;

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
        warnings.push_back(line(
            findings.faces,
            " faces were found and the largest one is used; stymo-fit --face N takes another one, "
            "counted from the left"));
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
    if (std::abs(degrees_from_radians(findings.yaw)) > largest_yaw_deg)
        warnings.push_back(
            line("the head is turned by ", std::lround(degrees_from_radians(findings.yaw)),
                 " degrees, and half of the face is hidden; use a photo from nearer the front"));
    if (findings.covered_share < least_covered || findings.covered_share > most_covered)
        warnings.push_back(line("the head mask covers ", percent(findings.covered_share),
                                " percent of the image; give ",
                                findings.made_mask ? "a mask" : "another mask"));
    if (findings.landmark_error > doubtful_landmark_error)
        warnings.push_back(
            line("the landmark error of the head model is ", percent(findings.landmark_error),
                 " percent of the image's side; the pose may be wrong, look at the overlay"));
    constexpr const char* ignore = "; if something covers them, leave it out with --ignore";
    if (findings.look.lower_face > covered_difference)
        warnings.push_back(line("mouth and chin have another colour than the forehead", ignore));
    if (findings.look.eyes > covered_difference)
        warnings.push_back(line("the eyes have another colour than nose and forehead", ignore));
    if (findings.look.brightness < dark)
        warnings.push_back(line("the photo is dark (its brightest parts reach ",
                                percent(findings.look.brightness),
                                " percent), so noise is fitted and scores say little; use a "
                                "brighter photo"));
    return warnings;
}

}  // namespace stymo
