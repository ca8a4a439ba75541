#pragma once

#include <cstdint>
#include <string>

#include "core/io/json_writer.h"
#include "train/trainer.h"

namespace stymo {

/// What a run would do.
struct TrainingPlan {
    std::int64_t encoder_parameters = 0;
    std::int64_t decoder_parameters = 0;
    std::int64_t images = 0;
    std::int64_t side = 0;  ///< of the images, in pixels
    StageConfig stage;
    double epochs = 0.0;
    double step_seconds = 0.0;
    double step_loss = 0.0;
    double peak_megabytes = 0.0;
};

/// Measures time, loss and peak memory of an optimiser step by doing one.
[[nodiscard]] TrainingPlan measure_plan(Trainer& trainer, const TrainConfig& config, const Dataset& training);
[[nodiscard]] std::string plan_text(const TrainingPlan& plan);
[[nodiscard]] JsonValue to_json(const TrainingPlan& plan);
/// One line on how a run ended.
[[nodiscard]] std::string outcome_text(const TrainingOutcome& outcome, const RunFolder& folder);
[[nodiscard]] JsonValue to_json(const TrainingOutcome& outcome, const RunFolder& folder);

}  // namespace stymo
