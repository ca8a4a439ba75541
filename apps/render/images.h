#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/common/explain.h"
#include "apps/render/shots.h"

namespace stymo {

/// Renders the shots and writes them to `out`: frames of a .gif or .mp4, tiles of any other image;
/// with masks beside it as OUT_mask of the same kind, and depths as OUT_depth.exr, of an animation
/// as OUT_NNNN_depth.exr for each frame. Returns the files; `explainer` gets the counts of the last
/// one. Throws Error before anything is written if a signal asks the process to stop.
[[nodiscard]] std::vector<std::filesystem::path> write_images(const std::filesystem::path& out,
                                                              const RenderOptions& options,
                                                              const Model& model,
                                                              const ShotList& list,
                                                              Explainer& explainer);

}  // namespace stymo
