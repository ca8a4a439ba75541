#pragma once

#include <array>
#include <cstdint>

#include "render/morphable/head_generator.h"

namespace stymo::morphable {

/// The vertices of the generated head that are nearest to dlib's 68 landmarks: jaw 0-16, brows
/// 17-26, nose 27-35, eyes 36-47, lips 48-67, each from the image's left.
[[nodiscard]] std::array<std::int32_t, 68> landmark_vertices(const HeadMesh& mesh,
                                                             const HeadParameters& parameters);

}  // namespace stymo::morphable
