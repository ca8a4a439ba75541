#pragma once

#include <cstdint>
#include <filesystem>

#include "train/train_config.h"

/// A model that is trained within a minute on synthetic heads.
namespace stymo {

/// The configuration demo-64, which the program contains, with these numbers of steps and samples
/// and without EMA.
[[nodiscard]] TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray);
/// Writes synthetic heads into an empty folder.
void write_small_heads(const std::filesystem::path& folder, std::uint64_t seed);
/// Trains the first stage on the folder `heads` for this number of seconds and writes the model to
/// `file`.
void write_small_model(const std::filesystem::path& heads, const std::filesystem::path& file,
                       std::uint64_t seed, double seconds);

}  // namespace stymo
