#pragma once

#include <memory>

#include "train/gradient_sums.h"

namespace stymo {

/// The ranks that mpirun or srun has started, or null if this process was started alone. Throws
/// ValueError if this process was started as a rank but built without Open MPI. All ranks end
/// together: the destructor waits for the others.
[[nodiscard]] std::unique_ptr<Ranks> started_ranks();

/// Ends all ranks at once, after an error on this rank.
[[noreturn]] void end_all_ranks();

/// Whether this build supports Open MPI.
[[nodiscard]] bool has_mpi();

}  // namespace stymo
