#include "apps/common/wait_policy.h"

#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace stymo {

void shorten_spinning(char** argv) {
    for (const char* name : {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"})
        if (std::getenv(name) != nullptr) return;
    for (char** argument = argv; *argument != nullptr; ++argument) {
        const std::string_view word = *argument;
        if (word == "--help" || word == "-h" || word == "--version") return;
    }
    if (::setenv("GOMP_SPINCOUNT", "1000", 1) == 0) ::execv("/proc/self/exe", argv);
}

}  // namespace stymo
