#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fit/photo/photo_look.h"

namespace stymo {

/// Properties of a prepared photo that decide its warnings.
struct PhotoFindings {
    std::int64_t faces = 1;  ///< number of faces found in the photo
    int quarter_turns = 0;   ///< clockwise turns of the photo that made its face stand upright
    double crop_side = 0.0;  ///< side of the crop in pixels of the photo
    std::int64_t wanted_side = 0;  ///< side of the resulting image
    double share_outside = 0.0;    ///< share of the crop's area outside the photo
    double covered_share = 0.5;    ///< share of the image that the head mask covers
    double yaw = 0.0;              ///< of the pose, in radians
    double landmark_error = 0.0;   ///< RMS distance of the model's landmarks from those found, in
                                   ///< units of the image's side
    bool made_mask = true;         ///< whether the mask was made rather than given
    PhotoLook look{};
};

/// One line per problem, with its remedy; none for a good photo.
[[nodiscard]] std::vector<std::string> photo_warnings(const PhotoFindings& findings);

}  // namespace stymo
