#pragma once

#include <cstdint>
#include <filesystem>

#include "train/train_config.h"

/// A model that is trained within a minute, on heads made for it.
namespace stymo {

inline constexpr std::int64_t small_side = 64;
inline constexpr std::int64_t small_heads = 240;
inline constexpr std::int64_t small_held_out = 20;  ///< the last ones

/// As configs/demo-64.json, but for steps and samples, and without averaged weights.
[[nodiscard]] TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray);
/// Synthetic heads in an empty folder.
void write_small_heads(const std::filesystem::path& folder, std::uint64_t seed);
/// Trains the first stage on them for so many seconds and writes the model to `file`.
void write_small_model(const std::filesystem::path& heads, const std::filesystem::path& file, std::uint64_t seed, double seconds);

}  // namespace stymo
