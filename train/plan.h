#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "train/memory_estimate.h"
#include "train/trainer.h"

namespace stymo {

struct PhasePlan {
    TrainingPhase phase;
    double epochs = 0.0;               ///< passes over the training images
    double estimated_megabytes = 0.0;  ///< peak memory of a step
    bool measured = false;
    /// Mean time of a step, including its share of R1. This and the following value are 0 unless
    /// measured.
    double step_seconds = 0.0;
    double step_loss = 0.0;  ///< of the first step
    /// Largest resident memory of the process during the steps of this phase. Nothing unless
    /// measured, and where the system cannot forget the peak of an earlier phase.
    std::optional<double> peak_megabytes{};
};

/// The phases of a run and their costs.
struct TrainingPlan {
    std::int64_t encoder_parameters = 0;
    std::int64_t decoder_parameters = 0;
    std::int64_t discriminator_parameters = 0;  ///< 0 without a discriminator
    std::string lpips_network{};  ///< Lpips::label(); empty without the perceptual term
    std::int64_t images = 0;
    std::int64_t side = 0;  ///< side of the images in pixels
    std::vector<PhasePlan> phases{};
};

/// Which phases are measured by optimiser steps: one step, and a second one if the first is one of
/// the phase's expensive steps (R1, or learning poses).
enum class MeasuredPhases { none, ends, all };

/// The plan of a run that has not begun. Measuring changes the weights, so the trainer must not be
/// used for the run afterwards.
[[nodiscard]] TrainingPlan measure_plan(Trainer& trainer, const TrainConfig& config,
                                        const Dataset& training, MeasuredPhases measured);
[[nodiscard]] std::string plan_text(const TrainingPlan& plan);
[[nodiscard]] JsonValue to_json(const TrainingPlan& plan);
/// One line on how a run ended.
[[nodiscard]] std::string outcome_text(const TrainingOutcome& outcome, const RunFolder& folder);
[[nodiscard]] JsonValue to_json(const TrainingOutcome& outcome, const RunFolder& folder);

}  // namespace stymo
