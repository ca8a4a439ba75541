#pragma once

#include <array>
#include <span>
#include <vector>

#include "fit/fitter.h"
#include "fit/head_depth.h"

namespace stymo {

/// The function that fitting minimises: the loss as a function of code offsets and, optionally, of
/// the poses. Optimisers set the values of its parameters.
class FitProblem {
public:
    /// All arguments must outlive the problem. Throws what `fit_codes` throws for unsuitable
    /// targets and options.
    FitProblem(const Model& model, const ReconstructionLoss& loss, const FaceBatch& faces,
               const FitOptions& options);

    struct Evaluation {
        double loss = 0.0;  ///< mean over the faces, without a side
        TermValues terms;
        /// Gradients of the sum over the faces: one for each of `offsets`, then of `orbits`.
        std::vector<Variable> gradients;
    };
    /// Evaluates the function at the current parameters. Throws what the decoder and the loss
    /// throw.
    [[nodiscard]] Evaluation evaluate();
    /// The loss at the current parameters, mean over the faces, with all samples and all images,
    /// whatever the last evaluation left out.
    [[nodiscard]] double complete_loss();

    /// The offsets of the fitted groups, zero at first.
    [[nodiscard]] const std::vector<Parameter>& offsets() const { return offsets_.all(); }
    /// The poses as orbit parameters (render/tracked_rays.h); empty if they are fixed.
    [[nodiscard]] const std::vector<Parameter>& orbits() const { return orbits_.all(); }

    /// Evaluates all samples with the current codes. Later evaluations leave out the samples whose
    /// weight is below the tolerance. Returns whether the function may have changed: with a
    /// tolerance of 0 nothing is evaluated.
    bool select_samples();
    /// Chooses the images that this step compares: only coarser ones at first
    /// (FitOptions::coarse_steps). Returns whether the choice has changed.
    bool choose_images(std::int64_t step);
    /// Every second step also compares who the faces are when they are seen from one side, in turn.
    /// Colours alone leave the sides of a face open.
    void choose_side(std::int64_t step);

    [[nodiscard]] const Codes& initial() const { return initial_; }
    [[nodiscard]] Codes codes() const;
    [[nodiscard]] std::vector<Camera> cameras() const;

private:
    /// As they are optimised (FitOptions::expression_directions).
    [[nodiscard]] Codes code_offsets() const;
    [[nodiscard]] FitLoss loss_here();
    [[nodiscard]] double mean_over_faces(const Variable& total) const {
        return total.value().item() / static_cast<double>(initial_.batch());
    }
    /// By face, the surface of its head, which is first moved to the rendered face.
    [[nodiscard]] std::vector<std::optional<FaceSurface>> aligned_surfaces(const Variable& depths);

    /// Of the faces seen from the chosen side.
    [[nodiscard]] Variable side_embeddings(const Codes& codes) const;

    const Model& model_;
    const ReconstructionLoss& loss_;
    const FaceBatch& faces_;
    const FitOptions& options_;
    FitWeights weights_;
    HeadDepth heads_;
    Codes initial_;
    ParameterStore offsets_;
    ParameterStore orbits_;
    DecodeOptions decode_;
    std::size_t image_count_ = 0;
    ReconstructionLoss::Target photos_;
    Tensor photo_embeddings_;  ///< undefined without the identity term
    /// How the faces are seen from the left and from the right.
    struct Side {
        std::vector<Camera> cameras;  ///< empty if the model cannot render one of them
        DecodeOptions decode;
    };
    std::array<Side, 2> sides_;
    const Side* side_ = nullptr;  ///< of this step; null: it compares none
};

}  // namespace stymo
