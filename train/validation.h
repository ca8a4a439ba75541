#pragma once

#include "nn/models/model.h"
#include "nn/models/reconstruction.h"
#include "train/data/dataset.h"

namespace stymo {

/// Mean scores of a model's images for the initial codes (face_codes).
struct ValidationScore {
    double reconstruction = 0.0;  ///< L_recon of training
    double psnr = 0.0;            ///< of the masked image, in decibels
};

/// The score on the first `count` faces, at one of the model's resolutions.
[[nodiscard]] ValidationScore validation_score(const Model& model,
                                               const ReconstructionLoss& reconstruction,
                                               const Dataset& faces, std::int64_t count,
                                               std::int64_t resolution,
                                               std::int64_t samples_per_ray);

}  // namespace stymo
