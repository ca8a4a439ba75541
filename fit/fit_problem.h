#pragma once

#include <vector>

#include "fit/fitter.h"

namespace stymo {

/// What fitting minimises: the loss as a function of code offsets and, if they learn, of the poses. Optimisers set the values of
/// its parameters, each in its own way.
class FitProblem {
public:
    /// All of it outlives the problem. Throws what `fit_codes` throws for targets and options that do not fit.
    FitProblem(const Model& model, const ReconstructionLoss& loss, const FitTarget& target, const FitOptions& options);

    struct Evaluation {
        double loss = 0.0;                ///< mean over the faces
        std::vector<Variable> gradients;  ///< of the sum over the faces: one for each of `offsets`, then of `orbits`
    };
    /// With the parameters as they are. Throws what the decoder and the loss throw.
    [[nodiscard]] Evaluation evaluate();

    /// The offsets of the four groups, zero at first.
    [[nodiscard]] const std::vector<Parameter>& offsets() const { return offsets_.all(); }
    /// The poses as orbit parameters (render/tracked_rays.h), or nothing.
    [[nodiscard]] const std::vector<Parameter>& orbits() const { return orbits_.all(); }

    /// From now on only samples that count with the codes as they are, if samples may be left out at all.
    void examine_samples();
    /// From now on the pictures of this step, coarser ones at first (FitOptions::coarse_steps). Whether they are others than
    /// before.
    bool choose_pictures(std::int64_t step);

    [[nodiscard]] const Codes& initial() const { return initial_; }
    [[nodiscard]] Codes codes() const { return add(initial_, code_offsets()); }
    [[nodiscard]] std::vector<Camera> cameras() const;

private:
    [[nodiscard]] Codes code_offsets() const;

    const Model& model_;
    const ReconstructionLoss& loss_;
    const FitTarget& target_;
    const FitOptions& options_;
    double regularizer_;
    Codes initial_;
    ParameterStore offsets_;
    ParameterStore orbits_;
    DecodeOptions decode_;
    std::size_t picture_count_ = 0;
    ReconstructionLoss::Target photos_;
};

}  // namespace stymo
