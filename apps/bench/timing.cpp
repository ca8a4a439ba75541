#include "apps/bench/timing.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>

#include "apps/bench/peak.h"
#include "core/clock.h"
#include "core/median.h"

namespace stymo {

void Timing::add(double run_seconds) {
    seconds.push_back(run_seconds);
    multiply_adds.push_back(kernels::measure_multiply_adds());
}

void Timing::add(const Timing& other) {
    seconds.insert(seconds.end(), other.seconds.begin(), other.seconds.end());
    multiply_adds.insert(multiply_adds.end(), other.multiply_adds.begin(),
                         other.multiply_adds.end());
}

double Timing::median() const {
    return stymo::median(seconds);
}

double Timing::minimum() const {
    return std::ranges::min(seconds);
}

double Timing::median_multiply_adds() const {
    return multiply_adds.empty() ? 0.0 : stymo::median(multiply_adds);
}

Timing time_repeated(int repeats, double at_least_seconds, const std::function<void()>& body) {
    constexpr int most = 100;
    body();
    Timing timing;
    const double begin = seconds_now();
    for (int i = 0; i < repeats || (i < most && seconds_now() - begin < at_least_seconds); ++i) {
        const double start = seconds_now();
        body();
        timing.add(seconds_now() - start);
    }
    return timing;
}

double peak_memory_mebibytes() {
    std::ifstream status("/proc/self/status");
    const std::string key = "VmHWM:";
    for (std::string line; std::getline(status, line);)
        if (line.starts_with(key)) return std::strtod(line.c_str() + key.size(), nullptr) / 1024.0;
    return 0.0;
}

}  // namespace stymo
