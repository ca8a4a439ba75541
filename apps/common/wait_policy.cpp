#include "apps/common/wait_policy.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>

namespace stymo {

void shorten_spinning(char** argv) {
    for (const char* name : {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"})
        if (std::getenv(name) != nullptr) return;
    for (char** argument = argv; *argument != nullptr; ++argument) {
        const std::string_view word = *argument;
        if (word == "--help" || word == "-h" || word == "--version") return;
    }
    // The link's target, because the process takes its name from the path that it is started by.
    std::error_code error;
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
    if (!error && ::setenv("GOMP_SPINCOUNT", "1000", 1) == 0) ::execv(program.c_str(), argv);
}

}  // namespace stymo
