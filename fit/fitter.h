#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "nn/models/face_batch.h"
#include "nn/models/reconstruction.h"

namespace stymo {

enum class FitOptimizer {
    adam,   ///< the paper's
    lbfgs,  ///< nn/optim/lbfgs.h, on all rows together
};

/// The state of a fit after a step.
struct FitStep {
    std::int64_t steps = 0;  ///< done
    double loss = 0.0;       ///< FitResult::losses.back()
    Codes codes;
};

struct FitOptions {
    std::optional<Codes> initial{};  ///< where fitting starts, in Z; none: `face_codes`
    FitOptimizer optimizer = FitOptimizer::adam;
    std::int64_t steps = 200;    ///< evaluations of loss and gradient
    double learning_rate = 0.0;  ///< 0: the model's own (ReconstructionConfig::fit_learning_rate)
    double decay = 0.99;         ///< Adam's factor on the learning rate after each step
    /// Weight of the sum of squared offsets; the model's own
    /// (ReconstructionConfig::fit_regularizer) if negative.
    double regularizer = -1.0;
    std::int64_t samples_per_ray = 0;  ///< 0: the model's own
    /// Every `selection_interval` steps, from the first on, all samples are evaluated. Until the
    /// next time, those of a smaller compositing weight are left out of image and gradient; 0: none
    /// are. This biases the gradient: docs/results.md has by how much.
    double tolerance = 0.001;
    std::int64_t selection_interval = 8;
    /// Keeps what the gradient needs of the field instead of computing it once more: faster by a
    /// fifth, for 4 bytes times the field's channels for each sample and sine layer. Done anyway
    /// where few samples are significant.
    bool keep_field = false;
    /// So many steps at the beginning compare the smaller images alone, in equal parts those up to
    /// 64 pixels, to 128 and so on: they cost less. The largest of them has the weight of the
    /// largest of all.
    std::int64_t coarse_steps = 0;
    /// The rows are photos of one person: identity and texture start at their mean and share their
    /// offset.
    bool one_person = false;
    /// The poses learn too, as orbit parameters (render/tracked_rays.h), with a rate of their own.
    bool refine_pose = false;
    double pose_learning_rate_factor = 0.1;
    std::function<void(const FitStep&)> on_step = {};
};

/// 1 for every sample whose compositing weight is at least the tolerance, 0 for the others:
/// DecodeOptions::significant_samples.
[[nodiscard]] Tensor significant_samples(const Tensor& weights, double tolerance);

struct FitResult {
    Codes initial;  ///< where fitting started, in Z
    Codes fitted;   ///< initial + offsets
    /// Mean over the faces, before each step. L-BFGS has the one that its iteration ended with for
    /// each evaluation of it.
    std::vector<double> losses;
    bool converged =
        false;  ///< L-BFGS found nothing lower, and ended before its steps were used up
    std::vector<Camera> cameras{};  ///< the target's, unless the poses learnt
};

/// The paper's fitting: Adam on code offsets that start at zero, everything else fixed unless asked
/// for; with Adam each face is its own problem whatever the batch, but for one person. `loss` is
/// the model's own reconstruction loss or another one. Throws ShapeError for targets that do not
/// suit the model, ValueError for a side that it does not render, NumericError if the loss becomes
/// non-finite.
[[nodiscard]] FitResult fit_codes(const Model& model, const ReconstructionLoss& loss,
                                  const FaceBatch& faces, const FitOptions& options);

}  // namespace stymo
