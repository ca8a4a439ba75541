#pragma once

#include <filesystem>

namespace stymo {

/// Checks that two run folders have the same files, the same statistics of each of `steps` steps,
/// and the same bits in the model and in the last checkpoint.
void check_same_run(const std::filesystem::path& run, const std::filesystem::path& expected,
                    int steps);

}  // namespace stymo
