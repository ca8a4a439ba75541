#pragma once

#include <filesystem>
#include <vector>

#include "apps/render/shots.h"
#include "nn/realtime/chosen_tolerance.h"

namespace stymo {

/// The files of a rendering, and how it was rendered.
struct WrittenImages {
    std::vector<std::filesystem::path> files;
    RenderMode mode = RenderMode::exact;
    double tolerance = 0.0;           ///< of a mode that tolerates
    std::optional<FrameError> error;  ///< of the views that were checked to choose the tolerance
};

/// Renders the shots and writes them to `out`: frames of a .gif, .webp or .mp4, tiles of any other
/// image. Masks are written to OUT_mask in the same format, and depths to OUT_depth.exr, or for
/// animations to OUT_NNNN_depth.exr for each frame; if `out` is an .exr file, it gets the depths,
/// and no image is rendered. Throws Error, before anything is written, if the process is
/// interrupted by a signal, and UsageError for an animation of more than 4 GiB.
[[nodiscard]] WrittenImages write_images(const std::filesystem::path& out,
                                         const RenderOptions& options, const Model& model,
                                         const ShotList& list);

/// Writes a folder with `faces.png`, a sheet of faces sampled from the distribution of the training
/// codes, and NNNN.json with the codes of each face. The n-th face depends only on the seed, not on
/// the number of faces. Returns the files. Throws FileError for a model without code statistics if
/// --data names no folder of faces.
[[nodiscard]] WrittenImages write_new_faces(const RenderOptions& options, const Model& model,
                                            std::uint64_t seed);

}  // namespace stymo
