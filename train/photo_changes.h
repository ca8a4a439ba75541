#pragma once

#include <string>
#include <vector>

#include "core/io/tensor_file.h"

namespace stymo {

/// Notes in a checkpoint which photos the run has.
void store_photo_ids(TensorFile& state, const std::vector<std::string>& ids);

/// Compares the photos of a checkpoint with those that a run has now. Rows of learnt offsets
/// (PhotoOffsets) and of their optimiser's moments follow their photos: those of photos that are
/// gone are dropped, new photos begin at zero. Returns one line that says what has changed; empty
/// if nothing has, or if a checkpoint of an older version names no photos and has no offsets.
[[nodiscard]] std::string follow_photos(TensorFile& state,
                                        const std::vector<std::string>& photo_ids);

}  // namespace stymo
