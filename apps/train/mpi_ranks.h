#pragma once

#include <memory>

#include "train/ranks.h"

namespace stymo {

/// The ranks that mpirun or srun has started, or null if this process was started by itself. Throws
/// ValueError in a process that was started as a rank by a tool built without Open MPI. All ranks
/// end together: the destructor waits for the others.
[[nodiscard]] std::unique_ptr<Ranks> started_ranks();

/// The name of this rank's host, for messages.
[[nodiscard]] std::string host_name();

/// Ends all ranks at once, because this one cannot go on.
[[noreturn]] void end_all_ranks();

/// Whether this build knows Open MPI.
[[nodiscard]] bool has_mpi();

}  // namespace stymo
