#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "core/rng.h"
#include "core/tensor.h"
#include "render/camera.h"
#include "render/morphable/head.h"

namespace stymo {

/// Codes, light and pose of one rendered head, the ground truth of its image.
struct SyntheticFace {
    std::vector<float> identity;    ///< 100
    std::vector<float> expression;  ///< 79
    std::vector<float> texture;     ///< 100
    std::vector<float> light;       ///< 27, see render/spherical_harmonics.h
    Pose pose;
};

struct SyntheticImage {
    Tensor color;  ///< (side, side, 3) in [0, 1], black wherever the mask is 0
    Tensor mask;   ///< (side, side, 1), 1 where the head covers at least half of the pixel, else 0
    /// In pixels from the upper left corner of the image.
    std::array<Eigen::Vector2d, 68> landmarks;
};

/// Standard normal codes cut off at 2.5 (one-sided expressions: the positive half, 0 otherwise);
/// yaw, pitch, roll normal with deviations 14, 6, 2 degrees within 35, 15, 5; the distance
/// about 5.3; light from the front and above, with some from the side and some colour.
[[nodiscard]] SyntheticFace sample_synthetic_face(const MorphableHead& head, Rng rng);

/// Draws the head under its light in front of black. Throws ValueError for a side below 1.
[[nodiscard]] SyntheticImage render_synthetic_face(const MorphableHead& head,
                                                   const SyntheticFace& face,
                                                   const Intrinsics& intrinsics, std::int64_t side);

struct SyntheticFaceSettings {
    std::int64_t count = 100;
    std::int64_t side = 128;
    Intrinsics intrinsics;
};

/// Writes `folder` in the format of FFHQ as this project reads it: images/00000.png,
/// masks/00000.png, faces.jsonl, camera.json. Face n is drawn from rng.split(n) alone: the same
/// seed gives the same bytes, and a greater count only adds faces. The files appear once all are
/// written, over those of the same name. `progress` is called with the number of faces done. Throws
/// FileError if the folder cannot be written or holds images that are not among those to be
/// written, Error once interrupted().
void write_synthetic_faces(const MorphableHead& head, const SyntheticFaceSettings& settings,
                           const Rng& rng, const std::filesystem::path& folder,
                           const std::function<void(std::int64_t)>& progress = {});

}  // namespace stymo
