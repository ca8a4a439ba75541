#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/rng.h"
#include "nn/pretrained/landmark_network.h"
#include "train/landmarks/head_pictures.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

struct LandmarkTrainingSettings {
    std::int64_t steps = 6000;
    std::int64_t batch = 32;
    double learning_rate = 1e-3;  ///< initial rate, which falls to 0 along half a cosine
    std::int64_t heads = 1500;    ///< number of rendered heads in memory
    std::int64_t new_heads = 2;   ///< how many of these heads are replaced by new ones in each step
    double photo_share = 0.5;     ///< share of photos in a batch, if there are any
};

/// Trains a landmark network on rendered heads in front of parts of `backgrounds` (height, width,
/// 3), and on `photos`, if there are any. Afterwards the model holds the moving average of its
/// weights. The same arguments give the same weights. `progress` is called after each step with its
/// number and loss (the mean distance of the points, in units of half the square's side). Throws
/// Error when interrupted() becomes true, NumericError if the loss is not finite.
void train_landmarks(LandmarkModel& model, const HeadPictures& pictures,
                     const std::vector<Tensor>& backgrounds,
                     const std::vector<LandmarkExample>& photos,
                     const LandmarkTrainingSettings& settings, const Rng& rng,
                     const std::function<void(std::int64_t, double)>& progress = {});

}  // namespace stymo
