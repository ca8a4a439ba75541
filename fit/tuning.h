#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "nn/models/face_batch.h"
#include "nn/models/reconstruction.h"
#include "render/morphable/head.h"

namespace stymo {

/// The state of tuning after a step.
struct TuningStep {
    std::int64_t steps = 0;  ///< number of steps done
    double seconds = 0.0;    ///< since tuning began
    double loss = 0.0;       ///< of the photo, before the step
};

struct TuningOptions {
    /// Tuning ends after `seconds` or `steps`, whichever comes first, but does at least one step;
    /// 0: no such limit. The result depends on the machine's speed unless `steps` comes first.
    double seconds = 0.0;
    std::int64_t steps = 0;
    double learning_rate = 3e-2;  ///< the largest rate: it rises over the first twentieth of the
                                  ///< time and then falls to 0 along a cosine
    /// Weight of the locality term, which every second step compares an image of the tuned decoder
    /// at an anchor with that of the original one. One of three anchors is a neighbouring code from
    /// a random camera. The others are the face itself from other sides; there the target has the
    /// photo's colours where the photo shows the same points (fit/turned_photo.h).
    double locality_weight = 2.0;
    /// The linear head to which the faces' codes belong; null: the tuned shape follows from colours
    /// alone. Where a face has a code, the depth of the tuned face is drawn to this head's, in the
    /// photo and at the anchors that show the face, and the anchors' targets are turned by it.
    const MorphableHead* head = nullptr;
    double depth_weight = 1.0;  ///< of the mean difference of depths, per distance of the eyes
    double neighbour_distance = 0.5;  ///< distance of neighbouring codes, in standard deviations
    std::int64_t anchors = 32;
    std::int64_t samples_per_ray = 0;  ///< 0: ReconstructionConfig::fit_samples_per_ray
    std::uint64_t seed = 0;            ///< seed of the anchors
    std::function<void(const TuningStep&)> on_step = {};
};

struct TuningResult {
    std::vector<double> losses;  ///< of the photo, before each step
    double seconds = 0.0;
};

/// Pivotal tuning (Roich et al. 2022), which the paper names as future work: trains the decoder on
/// the photos of one face, with fixed, fitted codes. Each step uses one photo, in turn. Field,
/// render blocks and mask branch change; the mapping networks do not. `tuned` must be a copy of
/// `original` and is frozen afterwards. Throws ValueError without any limit, NumericError if the
/// loss becomes non-finite.
[[nodiscard]] TuningResult tune_decoder(const Model& original, Model& tuned,
                                        const ReconstructionLoss& loss, const FaceBatch& faces,
                                        const Codes& codes, const std::vector<Camera>& cameras,
                                        const TuningOptions& options);

}  // namespace stymo
