#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "nn/models/face_batch.h"
#include "nn/models/reconstruction.h"

namespace stymo {

/// The state of tuning after a step.
struct TuningStep {
    std::int64_t steps = 0;  ///< done
    double seconds = 0.0;    ///< since tuning began
    double loss = 0.0;       ///< of the photo, before the step
};

struct TuningOptions {
    /// Tuning ends after so many seconds or so many steps, whichever comes first, but not before
    /// the first step; 0: no such limit.
    /// The result depends on the machine's speed unless `steps` comes first.
    double seconds = 0.0;
    std::int64_t steps = 0;
    double learning_rate = 1e-2;  ///< the highest; it rises over the first twentieth of the time
                                  ///< and then falls to 0 along a cosine
    /// Weight of the locality term: images of the tuned decoder at anchors against those of the
    /// original one. One anchor of three is a neighbouring code seen from anywhere; the others are
    /// the face itself from other sides, as the photo shows it where it does (fit/turned_photo.h).
    double locality_weight = 1.0;
    double neighbour_distance = 0.5;  ///< of neighbouring codes, in standard deviations
    std::int64_t anchors = 32;
    std::int64_t samples_per_ray = 0;  ///< 0: the model's own
    std::uint64_t seed = 0;            ///< of the anchors
    std::function<void(const TuningStep&)> on_step = {};
};

struct TuningResult {
    std::vector<double> losses;  ///< of the photo, before each step
    double seconds = 0.0;
};

/// Pivotal tuning (Roich et al. 2022), the paper's future work: the decoder learns the photos of
/// one face, whose codes are fitted and stay as they are, one photo in each step in turn. Field,
/// render blocks and mask branch change; the mapping networks do not. `tuned` begins as a copy of
/// `original` and is frozen afterwards. Throws ValueError without any limit, NumericError if the
/// loss becomes non-finite.
[[nodiscard]] TuningResult tune_decoder(const Model& original, Model& tuned,
                                        const ReconstructionLoss& loss, const FaceBatch& faces,
                                        const Codes& codes, const std::vector<Camera>& cameras,
                                        const TuningOptions& options);

}  // namespace stymo
