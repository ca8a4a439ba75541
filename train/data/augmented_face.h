#pragma once

#include "core/rng.h"
#include "nn/models/face_batch.h"

/// Photos of people who do not exist: real ones with other proportions and colours. An encoder that
/// learns from few people would otherwise learn them by heart.
namespace stymo {

/// The face with other proportions. The picture is stretched along each axis by a factor with a
/// deviation of 5 percent, and each of 5 x 5 points that are spread over it moves along each axis
/// by a distance with a deviation of 1.5 percent of the side, with bicubic interpolation between
/// them. Mask and known pixels move too. What lies outside the photo is unknown. Pose and code
/// stay. A pure function of face and generator.
[[nodiscard]] Face bent(const Face& face, Rng rng);

/// The face with other colours: each channel's values in [0, 1] are raised to a power and
/// multiplied by a factor, and saturation changes, all the same for every pixel. The logarithms of
/// power, factors and saturation have deviations of 0.2, 0.05 and 0.15, and a brightness that the
/// channels share has one of 0.1. Results are clipped to [0, 1]. Pose and code stay. A pure
/// function of face and generator.
[[nodiscard]] Face recolored(const Face& face, Rng rng);

}  // namespace stymo
