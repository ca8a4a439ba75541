#pragma once

#include "nn/models/model.h"
#include "nn/models/reconstruction.h"
#include "train/data/dataset.h"

namespace stymo {

/// Means over images of a model that shows the encoder's codes.
struct ValidationScore {
    double reconstruction = 0.0;  ///< L_recon, as in training
    double psnr = 0.0;            ///< of the masked image, in dB
};

/// On the first `count` faces, at a resolution of the model.
[[nodiscard]] ValidationScore validation_score(const Model& model,
                                               const ReconstructionLoss& reconstruction,
                                               const Dataset& faces, std::int64_t count,
                                               std::int64_t resolution,
                                               std::int64_t samples_per_ray);

}  // namespace stymo
