#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "apps/common/command_line.h"
#include "train/landmarks/landmark_training.h"

/// The commands of stymo-landmarks. The options must outlive the command line.
namespace stymo::landmarks {

struct TrainOptions {
    std::filesystem::path morphable;
    std::filesystem::path out;
    std::filesystem::path photos;
    std::int64_t photo_count = 0;
    std::filesystem::path sheet;
    std::optional<std::filesystem::path> initial_model;
    LandmarkTrainingSettings settings;
};
void declare_train(CommandLine& line, TrainOptions& options);

struct AdaptOptions {
    TrainOptions train;
    std::filesystem::path model;
    std::int64_t rounds = 2;
};
void declare_adapt(CommandLine& line, AdaptOptions& options);

struct MeasureOptions {
    std::filesystem::path marked;
    std::filesystem::path photos;
    std::filesystem::path model;
    std::filesystem::path overlays;
};
void declare_measure(CommandLine& line, MeasureOptions& options);

}  // namespace stymo::landmarks
