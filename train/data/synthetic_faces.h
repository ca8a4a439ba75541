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

/// Codes, light and pose of one rendered head: the ground truth for its image.
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
    /// In pixels, from the upper left corner of the image.
    std::array<Eigen::Vector2d, 68> landmarks;
};

/// Draws a random face. Codes are standard normal, truncated at 2.5 (one-sided expressions:
/// negative values become 0). Yaw, pitch and roll are normal with standard deviations of 14, 6 and
/// 2 degrees, limited to 35, 15 and 5 degrees. The distance is about 5.3. The light comes from the
/// front and above, with a random part from the side and a random tint.
[[nodiscard]] SyntheticFace sample_synthetic_face(const MorphableHead& head, Rng rng);

/// Renders the head with its light on a black background. Throws ValueError for a side below 1.
[[nodiscard]] SyntheticImage render_synthetic_face(const MorphableHead& head,
                                                   const SyntheticFace& face,
                                                   const Intrinsics& intrinsics, std::int64_t side);

struct SyntheticFaceSettings {
    std::int64_t count = 100;
    std::int64_t side = 128;
    Intrinsics intrinsics;
};

/// Writes a folder in the format of `scan_folder`: images/00000.png, masks/00000.png, faces.jsonl,
/// camera.json. Face n depends only on rng.split(n), so that the same seed gives the same bytes,
/// and a larger count only adds faces. The files are moved to `folder` after all are written, and
/// replace files of the same name. `progress` is called with the number of finished faces. Throws
/// FileError if the folder cannot be written or holds other images, Error when interrupted()
/// becomes true.
void write_synthetic_faces(const MorphableHead& head, const SyntheticFaceSettings& settings,
                           const Rng& rng, const std::filesystem::path& folder,
                           const std::function<void(std::int64_t)>& progress = {});

}  // namespace stymo
