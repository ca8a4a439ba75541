#pragma once

#include <optional>

#include "core/rng.h"
#include "nn/pretrained/landmark_network.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// A photo (height, width, 3) with landmarks that the network itself finds (pseudo-labels): the
/// means of its results for many squares around the face. Points whose results differ get a smaller
/// weight. Returns nothing if the results differ on average by more than a tenth of the distance of
/// the eyes, since the network then does not see a face.
[[nodiscard]] std::optional<LandmarkExample> example_of_photo(const LandmarkModel& model,
                                                              const Tensor& photo,
                                                              const FacePoints& found, Rng rng);

}  // namespace stymo
