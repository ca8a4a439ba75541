#include "apps/bench/timing.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>

#include "core/clock.h"

namespace stymo {

double Timing::median() const {
    std::vector<double> sorted = seconds;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::ranges::nth_element(sorted, middle);
    return *middle;
}

double Timing::minimum() const {
    return std::ranges::min(seconds);
}

Timing time_repeated(int repeats, double at_least_seconds, const std::function<void()>& body) {
    constexpr int most = 100;
    body();
    Timing timing;
    const double begin = seconds_now();
    for (int i = 0; i < repeats || (i < most && seconds_now() - begin < at_least_seconds); ++i) {
        const double start = seconds_now();
        body();
        timing.seconds.push_back(seconds_now() - start);
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
