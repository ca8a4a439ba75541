#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "train/checkpoint.h"
#include "train/data/dataset.h"
#include "train/gradient_sums.h"
#include "train/train_config.h"

namespace stymo {

/// The ranks that mpirun or srun has started, or null if this process was started alone. Throws
/// ValueError if this process was started as a rank but built without Open MPI. All ranks end
/// together: the destructor waits for the others.
[[nodiscard]] std::unique_ptr<Ranks> started_ranks();

/// Values that must be the same on all ranks: pairs of a name for messages and the compared text.
using CommonState = std::vector<std::pair<std::string, std::string>>;

/// Configuration, photos (names and sizes of the files), position of the run, and the initial
/// model, unless that path is empty.
[[nodiscard]] CommonState common_state(const TrainConfig& config, const Dataset& training,
                                       const TrainingState& state,
                                       const std::filesystem::path& initial_model);

/// The parts of a run with several ranks.
struct RankedRun {
    /// Runs on rank 0, before the others begin; may write files. Empty: there is nothing to do.
    std::function<void()> claim{};
    std::function<void()> prepare;  ///< must not write files or communicate with other ranks
    std::function<CommonState()> state;
    std::function<AppResult()> lead;  ///< runs on rank 0
    std::function<void()> follow;     ///< runs on all other ranks
};

/// Runs one rank. Only rank 0 prints results. If claim or preparation fails on any rank, or if the
/// ranks differ in their CommonState, in the program or in the precision of products, the first
/// problem is thrown on every rank. A later error is printed by the rank on which it occurs, and
/// ends all ranks at once.
AppResult run_as_rank(Ranks& ranks, const std::string& program, const RankedRun& run);
/// Runs the parts as one of the ranks that mpirun has started, or alone.
AppResult run_on_ranks(const std::string& program,
                       const std::function<RankedRun(Ranks& ranks)>& parts);

}  // namespace stymo
