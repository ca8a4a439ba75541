#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string_view>

namespace stymo {

/// The limits that control groups set (Linux, cgroup version 1 and 2), as containers and job
/// schedulers do.
struct MachineLimits {
    double processors = std::numeric_limits<double>::infinity();
    std::int64_t memory_bytes = std::numeric_limits<std::int64_t>::max();
};

/// The smallest limits of the groups to which this process belongs, and of the groups around them.
/// `root` stands for "/" in tests. Files that are missing or malformed set no limit.
[[nodiscard]] MachineLimits control_group_limits(const std::filesystem::path& root = "/");

/// Number of processors that this process may use, at least 1: those of its affinity, and no more
/// than the limit of its control groups rounded up. Found at the first call.
[[nodiscard]] int usable_processors();
/// Memory that this process may use: that of the machine, or the limit of its control groups. Found
/// at the first call.
[[nodiscard]] std::int64_t usable_memory_bytes();

/// Bytes of this process by a name of /proc/self/status: "VmRSS:" for its resident memory, "VmHWM:"
/// for the largest so far. 0 if the system does not tell.
[[nodiscard]] double process_memory(std::string_view name);

}  // namespace stymo
