#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/common/explain.h"
#include "apps/render/shots.h"

namespace stymo {

/// Renders the shots and writes them to `out`: frames of a .gif or .mp4, tiles of any other image.
/// Masks are written to OUT_mask in the same format, and depths to OUT_depth.exr, or for animations
/// to OUT_NNNN_depth.exr for each frame. Returns the files. `explainer` gets the counts of the last
/// frame. Throws Error, before anything is written, if the process is interrupted by a signal.
[[nodiscard]] std::vector<std::filesystem::path> write_images(const std::filesystem::path& out,
                                                              const RenderOptions& options,
                                                              const Model& model,
                                                              const ShotList& list,
                                                              Explainer& explainer);

}  // namespace stymo
