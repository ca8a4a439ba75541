#pragma once

#include "core/rng.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// Draws what portraits show beside the face, at random: hair behind the head and over its sides
/// and forehead, neck and clothes, glasses. The image has 4 channels.
void draw_portrait_parts(LandmarkExample& example, Rng rng);

}  // namespace stymo
