#pragma once

#include <memory>

#include "nn/engine/precision.h"
#include "nn/models/model.h"
#include "nn/models/realtime/field_source.h"

namespace stymo {

/// The field computed anew for every view: all samples in mode `exact`, those that a density grid
/// of the head finds significant in modes `skip` and `half`. What is left out counts with its
/// estimated density towards the sample behind it.
[[nodiscard]] std::unique_ptr<FieldSource> make_sampled_field(const ModelConfig& model,
                                                              const RendererOptions& options,
                                                              Precision precision);

}  // namespace stymo
