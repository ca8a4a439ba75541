#pragma once

#include <string>
#include <vector>

namespace stymo {

/// The exit code and the output of a program.
struct ChildOutcome {
    int exit_code = -1;  ///< -1: killed by a signal; 127: program not found
    std::string out;
    std::string err;
    double peak_memory = 0.0;  ///< MiB
};

/// Runs a program (searched in PATH) to its end, with `variables` ("NAME=value") added to the
/// environment. The program is killed if this process ends. Throws Error if no process can be
/// created.
[[nodiscard]] ChildOutcome run_child(const std::vector<std::string>& words,
                                     const std::vector<std::string>& variables = {});

/// Path of the running program.
[[nodiscard]] std::string own_program();

}  // namespace stymo
