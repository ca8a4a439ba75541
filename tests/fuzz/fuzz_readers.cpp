// What libFuzzer calls. STYMO_FUZZ_READER names the reader.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "fuzz/readers.h"

namespace {

const stymo::fuzz::Reader& chosen_reader() {
    const char* name = std::getenv("STYMO_FUZZ_READER");
    const auto found = stymo::fuzz::readers().find(name == nullptr ? "" : name);
    if (found != stymo::fuzz::readers().end()) return found->second;
    std::cerr << "STYMO_FUZZ_READER must be one of";
    for (const auto& [known, reader] : stymo::fuzz::readers()) std::cerr << ' ' << known;
    std::cerr << '\n';
    std::exit(2);
}

/// Seconds that this process has computed. Other work on the machine does not count.
double computed_seconds() {
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// Aborts after a call that takes longer than a second, and prints the longest one at the end.
class Stopwatch {
public:
    ~Stopwatch() {
        std::cerr << "stat::slowest_call_ms: " << static_cast<int>(1e3 * slowest_) << std::endl;
    }
    void add(double seconds) {
        constexpr double limit = 1.0;
        slowest_ = std::max(slowest_, seconds);
        if (seconds > limit) {
            std::cerr << "ERROR: this call took " << seconds << " seconds" << std::endl;
            std::abort();
        }
    }

private:
    double slowest_ = 0.0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const stymo::fuzz::Reader& read = chosen_reader();
    static const bool on_one_thread = (stymo::set_thread_count(1), true);
    static_cast<void>(on_one_thread);
    static Stopwatch stopwatch;
    const double start = computed_seconds();
    try {
        read(std::string(reinterpret_cast<const char*>(data), size));
    } catch (const stymo::Error& error) {
        // Any other exception ends the program, as does a refusal without a word.
        if (*error.what() == '\0') std::abort();
    }
    stopwatch.add(computed_seconds() - start);
    return 0;
}
