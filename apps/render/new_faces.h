#pragma once

#include <filesystem>
#include <vector>

#include "apps/common/explain.h"
#include "apps/render/images.h"
#include "apps/render/options.h"

namespace stymo {

/// Writes a folder with `faces.png`, a sheet of faces sampled from the distribution of the training
/// codes, and NNNN.json with the codes of each face. The n-th face depends only on the seed, not on
/// the number of faces. Returns the files. Throws FileError for a model without code statistics if
/// --data names no folder of faces.
[[nodiscard]] WrittenImages write_new_faces(const RenderOptions& options, const Model& model,
                                            std::uint64_t seed, Explainer& explainer);

}  // namespace stymo
