#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "train/train_config.h"

/// Configurations that are embedded in the program, and a model that is trained within a minute on
/// synthetic heads.
namespace stymo {

/// The configuration configs/`name`.json with overrides "a.b=value". Throws ConfigError.
[[nodiscard]] TrainConfig embedded_configuration(const std::string& name,
                                                 const std::vector<std::string>& overrides);

inline constexpr std::int64_t small_heads = 240;

/// The configuration demo-64 with these numbers of steps and samples and without EMA.
[[nodiscard]] TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray);
/// Writes synthetic heads into an empty folder.
void write_small_heads(const std::filesystem::path& folder, std::uint64_t seed);
/// Trains the first stage on the folder `heads` for this number of seconds and writes the model to
/// `file`.
void write_small_model(const std::filesystem::path& heads, const std::filesystem::path& file,
                       std::uint64_t seed, double seconds);

}  // namespace stymo
