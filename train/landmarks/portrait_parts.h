#pragma once

#include "core/rng.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// Draws random parts of a portrait besides the face: hair behind the head and over its sides and
/// forehead, neck and clothes, glasses. The example's image must have 4 channels.
void draw_portrait_parts(LandmarkExample& example, Rng rng);

}  // namespace stymo
