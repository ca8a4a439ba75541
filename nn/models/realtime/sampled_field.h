#pragma once

#include <memory>

#include "nn/models/model.h"
#include "nn/models/realtime/field_source.h"
#include "nn/models/realtime/precision.h"

namespace stymo {

/// The field computed anew for every view: all samples in mode `exact`, those that a density grid of the head leaves over in
/// modes `skip` and `bf16`. What is left out counts with its estimated density towards the sample behind it.
[[nodiscard]] std::unique_ptr<FieldSource> make_sampled_field(const ModelConfig& model, const RendererOptions& options,
                                                              Precision precision);

}  // namespace stymo
