#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "fit/fit_objective.h"
#include "nn/models/face_batch.h"
#include "nn/models/reconstruction.h"
#include "render/morphable/head.h"

namespace stymo {

/// The state of tuning after a step.
struct TuningStep {
    std::int64_t steps = 0;  ///< number of steps done
    double seconds = 0.0;    ///< since tuning began
    /// Of the step's photo, before the step. Insignificant samples may be left out.
    double loss = 0.0;
};

struct TuningOptions {
    /// Tuning ends after `seconds` or `steps`, whichever comes first, but does at least one step;
    /// 0: no such limit. The result depends on the machine's speed unless `steps` comes first.
    double seconds = 0.0;
    std::int64_t steps = 0;
    /// The largest learning rate, that of the matrices of render blocks and mask branch. Those of
    /// the field get a tenth of it, and all other parameters a tenth of what matrices beside them
    /// get. It rises over the first twentieth of the time and then falls to 0 along a cosine.
    /// 0: usual_tuning_rate() of the number of steps that the limits leave time for.
    double learning_rate = 0.0;
    /// Every third step compares an image of the tuned decoder with a target at one of `anchors`
    /// anchors, in turn. One anchor of three is a neighbouring code, half a standard deviation
    /// away, from a random camera; its target is the original decoder's image. The others are the
    /// face itself from other sides; their target has the photo's colours where the photo shows the
    /// same points (render/turned_photo.h), elsewhere those of the original decoder. A locality
    /// weight of 0: there are no anchors. The weight of identity is that of the face at the anchors
    /// that show it from other sides.
    FitWeights weights{.regularizer = 0.0,
                       .perceptual = 48.0,
                       .locality = 6.0,
                       .depth = 3.0,
                       .mask = 0.15,
                       .identity = 0.6};
    /// The linear head to which the faces' codes belong; null: the tuned shape follows from colours
    /// alone. Where a face has a code, the depth of the tuned face is drawn to this head's: in
    /// every step in the photo, and at the anchors that show the face from other sides. Their
    /// targets are turned by it.
    const MorphableHead* head = nullptr;
    std::int64_t anchors = 24;  ///< each is made when it is first needed; 0: none
    /// Samples of a smaller compositing weight get no gradient. Seven of eight comparisons with a
    /// photo or an anchor leave them out of the image, too. 0: no sample is left out.
    double tolerance = 0.001;
    std::int64_t samples_per_ray = 0;  ///< 0: ReconstructionConfig::fit_samples_per_ray
    std::uint64_t seed = 0;            ///< seed of the anchors
    std::function<void(const TuningStep&)> on_step = {};
};

/// The largest learning rate of a tuning of so many steps: 0.09 from 100 steps on. Below, it falls
/// with their root, because few large steps leave noise in the image.
[[nodiscard]] double usual_tuning_rate(double steps);

struct TuningResult {
    std::vector<double> losses;  ///< as in TuningStep, of each step
    double seconds = 0.0;
    TermValues terms{};  ///< of the last step's photo
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
