#pragma once

#include <string>

#include "core/io/json_writer.h"
#include "train/trainer.h"

namespace stymo {

/// What a run would do: parameters, images, steps, and the time and peak memory of one optimiser step, measured by doing one.
[[nodiscard]] std::string plan_text(Trainer& trainer, const TrainConfig& config, const Dataset& training);
/// One line on how a run ended.
[[nodiscard]] std::string outcome_text(const TrainingOutcome& outcome, const RunFolder& folder);
[[nodiscard]] JsonValue to_json(const TrainingOutcome& outcome, const RunFolder& folder);

}  // namespace stymo
