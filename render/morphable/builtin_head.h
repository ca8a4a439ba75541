#pragma once

#include "render/morphable/head.h"

namespace stymo {

/// The built-in head, which is generated without scans or data files. It has about 15,000 vertices
/// and fits, with its hair, into the image of the default pose of render/camera.h. Rows of the
/// bases: identity has 28 proportions, 24 measures of features and hair, then smooth bumps;
/// expression has jaw, two lids, gaze x and y, 20 movements of mouth, brows, cheeks and nose, then
/// smooth bumps on the face; texture has 23 tints (skin, hair, brows, lips, eyes, beard), then
/// smooth stains. The first call generates it; it stays in memory (50 MB) until the program ends.
[[nodiscard]] const MorphableHead& builtin_head();

}  // namespace stymo
