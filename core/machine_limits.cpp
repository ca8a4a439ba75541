#include "core/machine_limits.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

namespace stymo {

namespace fs = std::filesystem;

namespace {

/// The numbers at the beginning of a file; "max" and everything else end them.
std::vector<double> numbers_in(const fs::path& file) {
    std::ifstream stream(file);
    std::vector<double> numbers;
    for (double number = 0.0; stream >> number;) numbers.push_back(number);
    return numbers;
}

std::optional<double> number_in(const fs::path& file) {
    const std::vector<double> numbers = numbers_in(file);
    return numbers.empty() ? std::nullopt : std::optional(numbers.front());
}

void limit_processors(MachineLimits& limits, double quota, double period) {
    // A quota of -1 means no limit.
    if (quota > 0.0 && period > 0.0)
        limits.processors = std::min(limits.processors, quota / period);
}

void limit_memory(MachineLimits& limits, double bytes) {
    // Version 1 writes a number near the largest one where there is no limit.
    constexpr double no_limit = 9e18;
    if (bytes > 0.0 && bytes < no_limit)
        limits.memory_bytes = std::min(limits.memory_bytes, static_cast<std::int64_t>(bytes));
}

/// Reads the files that the folder of a group may have, in either version.
void apply_group(MachineLimits& limits, const fs::path& folder) {
    const std::vector<double> both = numbers_in(folder / "cpu.max");
    if (both.size() == 2) limit_processors(limits, both[0], both[1]);
    const std::optional<double> quota = number_in(folder / "cpu.cfs_quota_us");
    const std::optional<double> period = number_in(folder / "cpu.cfs_period_us");
    if (quota && period) limit_processors(limits, *quota, *period);
    for (const char* name : {"memory.max", "memory.limit_in_bytes"})
        if (const std::optional<double> bytes = number_in(folder / name))
            limit_memory(limits, *bytes);
}

/// The group's folder and those around it, up to that of the hierarchy. A container may see its own
/// group as the hierarchy's root while /proc still names the path outside.
void apply_groups(MachineLimits& limits, const fs::path& hierarchy, const std::string& group) {
    for (fs::path path = fs::path(group).relative_path();; path = path.parent_path()) {
        apply_group(limits, hierarchy / path);
        if (path.empty()) return;
    }
}

}  // namespace

MachineLimits control_group_limits(const fs::path& root) {
    MachineLimits limits;
    const fs::path mounted = root / "sys/fs/cgroup";
    std::ifstream stream(root / "proc/self/cgroup");
    // Lines such as "0::/job" (version 2) and "4:cpu,cpuacct:/job" (version 1).
    for (std::string line; std::getline(stream, line);) {
        const std::size_t first = line.find(':'), second = line.find(':', first + 1);
        if (first == std::string::npos || second == std::string::npos) continue;
        const std::string controllers = line.substr(first + 1, second - first - 1);
        const std::string group = line.substr(second + 1);
        if (controllers.empty()) apply_groups(limits, mounted, group);
        std::istringstream names(controllers);
        for (std::string name; std::getline(names, name, ',');)
            if (name == "cpu" || name == "memory") {
                apply_groups(limits, mounted / name, group);
                apply_groups(limits, mounted / controllers, group);
            }
    }
    return limits;
}

namespace {

/// Processors to which the process is bound.
int bound_processors() {
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0) return CPU_COUNT(&set);
    return static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
}

}  // namespace

int usable_processors() {
    static const int count = [] {
        const double limit = std::ceil(control_group_limits().processors);
        return std::max(1, static_cast<int>(std::min<double>(bound_processors(), limit)));
    }();
    return count;
}

std::int64_t usable_memory_bytes() {
    static const std::int64_t bytes = [] {
        const std::int64_t machine =
            static_cast<std::int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGESIZE);
        return std::min(machine, control_group_limits().memory_bytes);
    }();
    return bytes;
}

double process_memory(std::string_view name) {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;)
        if (double kibibytes = 0.0; word == name && status >> kibibytes) return 1024.0 * kibibytes;
    return 0.0;
}

}  // namespace stymo
