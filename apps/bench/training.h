#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "apps/bench/subject.h"
#include "train/data/dataset.h"
#include "train/train_config.h"
#include "train/trainer.h"

/// Trainings on synthetic heads: whole steps, and a model that is trained within a minute.
namespace stymo {

/// Steps of the first stage of an embedded configuration ("celeba-128"): its batch, encoder with
/// backbone, LPIPS, optimiser, EMA. The weights of backbone and LPIPS are random ones, which does
/// not change the time.
class TrainingSteps {
public:
    TrainingSteps(const std::string& configuration, std::uint64_t seed);

    void step() { static_cast<void>(trainer_.step()); }
    [[nodiscard]] const TrainConfig& config() const { return config_; }
    [[nodiscard]] const Model& model() const { return trainer_.model(); }

private:
    TrainConfig config_;
    Dataset faces_;
    Trainer trainer_;
};

/// The configuration demo-64, which the program contains, with these numbers of steps and samples
/// and without EMA.
[[nodiscard]] TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray);
/// Writes synthetic heads and a model that is trained on them for less than a minute into an empty
/// folder, and makes them the data and the model of `bench`.
void train_small_subject(const std::filesystem::path& folder, BenchOptions& bench);

}  // namespace stymo
