#pragma once

#include <cstdint>
#include <filesystem>

#include "train/train_config.h"

/// A model that is trained within a minute, on synthetic heads.
namespace stymo {

inline constexpr std::int64_t small_heads = 240;

/// configs/demo-64.json, which is part of the program, with other numbers of steps and of samples
/// and without the EMA.
[[nodiscard]] TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray);
/// Writes synthetic heads into an empty folder.
void write_small_heads(const std::filesystem::path& folder, std::uint64_t seed);
/// Trains the first stage on them for so many seconds and writes the model to `file`.
void write_small_model(const std::filesystem::path& heads, const std::filesystem::path& file,
                       std::uint64_t seed, double seconds);

}  // namespace stymo
