#pragma once

#include <optional>

#include "core/rng.h"
#include "nn/models/landmark_network.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// A photo (height, width, 3) with the landmarks that a network finds itself: the means of its
/// answers for many squares around the face. A point whose answers differ counts less. None if the
/// answers differ by more than a tenth of the distance of the eyes on average: there is no face, or
/// the network does not see it.
[[nodiscard]] std::optional<LandmarkExample> example_of_photo(const LandmarkModel& model,
                                                              const Tensor& photo,
                                                              const FacePoints& found, Rng rng);

}  // namespace stymo
