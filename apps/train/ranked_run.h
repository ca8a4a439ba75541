#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "train/checkpoint.h"
#include "train/data/dataset.h"
#include "train/ranks.h"
#include "train/train_config.h"

namespace stymo {

/// What must be the same on all ranks: a name for messages, and what is compared.
using CommonState = std::vector<std::pair<std::string, std::string>>;

/// Program, configuration, photos (names and sizes of the files), position of a run, and the model
/// that it begins with, if that is not empty.
[[nodiscard]] CommonState common_state(const TrainConfig& config, const Dataset& training,
                                       const TrainingState& state,
                                       const std::filesystem::path& initial_model);

/// The parts of a run that several ranks do together.
struct RankedRun {
    std::function<void()> prepare;  ///< without writing, and without a word to other ranks
    std::function<CommonState()> state;
    std::function<AppResult()> lead;  ///< on rank 0
    std::function<void()> follow;     ///< on all others
};

/// Rank 0 speaks for all: the others print nothing. If the preparation fails anywhere, or if the
/// ranks differ in what must be the same, the first problem is thrown on every rank. An error after
/// that is printed by the rank that has it, and ends all ranks at once.
AppResult run_as_rank(Ranks& ranks, const std::string& program, const RankedRun& run);

}  // namespace stymo
