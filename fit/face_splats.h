#pragma once

#include <cstdint>
#include <functional>

#include "nn/models/model.h"
#include "render/splats.h"

namespace stymo {

/// A face (row 0 of `codes`) as about `count` splats: spread over the density's surface in 25
/// views, up to 45 degrees to either side, then fitted to the model's frames of these views.
/// `observe` is told about the share of the work that is done. The result does not depend on the
/// number of threads. Throws ValueError if `count` is not positive or so small that its grid misses
/// the face, or nothing of the face is inside its head mask, and what `surface_views` throws.
[[nodiscard]] Splats face_splats(const Model& model, const Codes& codes, std::int64_t count,
                                 const std::function<void(double)>& observe = {});

}  // namespace stymo
