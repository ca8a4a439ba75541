#pragma once

#include "apps/common/explain.h"
#include "fit/fitter.h"
#include "nn/models/realtime/face_renderer.h"
#include "train/trainer.h"

/// What the tools make, compute and leave out, read off what they have made.
namespace stymo {

[[nodiscard]] WorkPlan render_plan(const Model& model, const RendererOptions& options);
/// A fit by `loss`, which was made of `config`; `metric`: the LPIPS that the result is measured with, null for none.
[[nodiscard]] WorkPlan fit_plan(const Model& model, const ReconstructionConfig& config, const ReconstructionLoss& loss,
                                const Lpips* metric, const FitOptions& options);
[[nodiscard]] WorkPlan train_plan(const TrainConfig& config, const Trainer& trainer);

/// What a renderer counts of its last frame.
void add_counts(Explainer& explainer, const RenderCounts& counts);

}  // namespace stymo
