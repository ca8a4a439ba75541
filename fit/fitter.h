#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "fit/fit_objective.h"
#include "nn/models/face_batch.h"
#include "nn/models/reconstruction.h"
#include "render/morphable/head.h"

namespace stymo {

enum class FitOptimizer {
    adam,   ///< the paper's
    lbfgs,  ///< nn/optim/lbfgs.h, jointly for all rows
};

/// The state of a fit after a step.
struct FitStep {
    std::int64_t steps = 0;  ///< number of steps done
    double loss = 0.0;       ///< FitResult::losses.back()
    Codes codes;
};

struct FitOptions {
    std::optional<Codes> initial{};  ///< start of the fit in Z; empty: `face_codes`
    FitOptimizer optimizer = FitOptimizer::adam;
    std::int64_t steps = 200;    ///< evaluations of loss and gradient
    double learning_rate = 0.0;  ///< 0: ReconstructionConfig::fit_learning_rate
    double decay = 0.99;         ///< Adam's factor on the learning rate after each step
    FitWeights weights{.depth = 0.25, .identity = 0.2};
    std::int64_t samples_per_ray = 0;  ///< 0: ReconstructionConfig::fit_samples_per_ray
    /// Every `selection_interval` steps (iterations of L-BFGS), from the first on, all samples are
    /// evaluated. Until the
    /// next evaluation, samples of a smaller compositing weight are left out of image and gradient;
    /// 0: none is left out. docs/studies/samples-of-a-fit.md has the bias of the gradient.
    double tolerance = 0.001;
    std::int64_t selection_interval = 8;
    /// Keeps the field's activations for the gradient instead of computing them again. This is
    /// faster by a fifth and takes 4 bytes times the field's channels for each sample and sine
    /// layer. They are kept anyway if few samples are significant.
    bool keep_field = false;
    /// Number of steps at the beginning that compare only smaller images, which is cheaper: equal
    /// numbers of steps up to 64 pixels, up to 128 pixels and so on. In each of these steps the
    /// largest compared image has the weight of the model's largest image.
    std::int64_t coarse_steps = 0;
    /// The rows are photos of one person: identity and texture start at the mean over the rows and
    /// share one offset.
    bool one_person = false;
    /// The groups of codes, in the order of `code_names`, that are optimised; others stay
    /// `initial`.
    std::array<bool, 4> fitted_groups{true, true, true, true};
    /// (79, 79), C: the optimised and regularised numbers u of the expression move it by u C.
    /// Undefined: they move it by u.
    Tensor expression_directions{};
    /// Of the frame before the first row, (1, 79), for FitWeights::time; undefined: there is none.
    Tensor expression_before{};
    /// Also optimises the poses, as orbit parameters (render/tracked_rays.h), with
    /// `pose_learning_rate_factor` times the learning rate.
    bool refine_pose = false;
    double pose_learning_rate_factor = 0.1;
    /// The linear head to which the faces' codes belong; null: depth follows from colours alone.
    /// Where a face has such a code, the depth of its fit is drawn to this head's, up to a shift.
    const MorphableHead* head = nullptr;
    std::function<void(const FitStep&)> on_step = {};
    /// Also computes the losses of FitResult at both ends, each as dear as some steps.
    bool end_losses = true;
};

struct FitResult {
    Codes initial;  ///< start of the fit, in Z
    Codes fitted;   ///< initial + offsets
    /// Loss before each step, mean over the faces. With L-BFGS, all evaluations of an iteration
    /// have the loss at its end.
    std::vector<double> losses;
    /// L-BFGS found no lower value and ended before all steps were used.
    bool converged = false;
    std::vector<Camera> cameras{};  ///< the target's, or the optimised ones
    TermValues terms{};             ///< of the last evaluation
    /// The loss with all samples and all images before the first step and after the last one, which
    /// `losses` may miss; 0 for a fit without steps, and without FitOptions::end_losses.
    double initial_loss = 0.0, final_loss = 0.0;
};

/// The paper's fitting. The largest target counts as much as the model's largest image would, which
/// it need not reach. It optimises code offsets that start at zero (with Adam in the paper).
/// Everything else is fixed unless the options say otherwise. With Adam the result for a face does
/// not depend on the other faces of the batch, except with `one_person`. `loss` is usually the
/// model's reconstruction loss. Throws ShapeError for targets that do not match the model,
/// ValueError for a side that the model does not render, NumericError if the loss becomes
/// non-finite.
[[nodiscard]] FitResult fit_codes(const Model& model, const ReconstructionLoss& loss,
                                  const FaceBatch& faces, const FitOptions& options);

}  // namespace stymo
