#pragma once

#include "render/morphable/head.h"

namespace stymo {

/// The built-in head, which is generated without scans or data files. About 15,000 vertices. The
/// default pose of render/camera.h frames it, hair included. identity: 28 proportions, 24 measures
/// of features and hair, then smooth bumps. expression: jaw, two lids, gaze x and y, 20 movements
/// of mouth, brows, cheeks and nose, then smooth bumps on the face. texture: 23 tints (skin, hair,
/// brows, lips, eyes, beard), then smooth stains.
[[nodiscard]] MorphableHead builtin_head();

}  // namespace stymo
