#pragma once

#include <memory>

#include "nn/models/model.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/field_source.h"

namespace stymo {

/// A source that evaluates the field for every view: at all samples in mode `exact`, and in mode
/// `skip` at those that a density grid of the head finds significant. The estimated optical depth
/// of samples that are left out is added to the next sample behind them.
[[nodiscard]] std::unique_ptr<FieldSource> make_sampled_field(const ModelConfig& model,
                                                              const RendererOptions& options);

}  // namespace stymo
