#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>

#include "core/io/scratch_folder.h"
#include "core/machine_limits.h"
#include "core/parallel.h"

using namespace stymo;

namespace {

/// A copy of the files in which the kernel tells of control groups.
class Root {
public:
    void put(const std::string& name, const std::string& text) const {
        const std::filesystem::path file = scratch_.path() / name;
        std::filesystem::create_directories(file.parent_path());
        std::ofstream(file) << text;
    }
    [[nodiscard]] MachineLimits limits() const { return control_group_limits(scratch_.path()); }

private:
    ScratchFolder scratch_;
};

}  // namespace

TEST_CASE("Without control groups there are no limits", "[machine_limits]") {
    const MachineLimits limits = Root().limits();
    CHECK(std::isinf(limits.processors));
    CHECK(limits.memory_bytes == std::numeric_limits<std::int64_t>::max());
}

TEST_CASE("Control groups of version 2 limit processors and memory, those around them too",
          "[machine_limits]") {
    const Root root;
    root.put("proc/self/cgroup", "0::/slurm/job7\n");
    root.put("sys/fs/cgroup/slurm/job7/cpu.max", "250000 100000\n");
    root.put("sys/fs/cgroup/slurm/job7/memory.max", "max\n");
    root.put("sys/fs/cgroup/slurm/cpu.max", "max 100000\n");
    root.put("sys/fs/cgroup/slurm/memory.max", "3221225472\n");
    CHECK(root.limits().processors == 2.5);
    CHECK(root.limits().memory_bytes == 3221225472);
    root.put("sys/fs/cgroup/cpu.max", "100000 100000\n");
    CHECK(root.limits().processors == 1.0);
}

TEST_CASE("Control groups of version 1 limit processors and memory", "[machine_limits]") {
    const Root root;
    root.put("proc/self/cgroup", "5:memory:/docker/ab\n4:cpu,cpuacct:/docker/ab\n1:name=x:/\n");
    // As a container sees them: its own group is the root of the hierarchy.
    root.put("sys/fs/cgroup/memory/memory.limit_in_bytes", "2147483648\n");
    root.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "150000\n");
    root.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us", "100000\n");
    CHECK(root.limits().processors == 1.5);
    CHECK(root.limits().memory_bytes == 2147483648);
    root.put("sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "-1\n");
    root.put("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
    CHECK(std::isinf(root.limits().processors));
    CHECK(root.limits().memory_bytes == std::numeric_limits<std::int64_t>::max());
}

TEST_CASE("Files of control groups that say nothing set no limit", "[machine_limits]") {
    const Root root;
    root.put("proc/self/cgroup", "nonsense\n0::/../..\n0::\n");
    root.put("sys/fs/cgroup/cpu.max", "0 0\n");
    root.put("sys/fs/cgroup/memory.max", "-5\n");
    CHECK(std::isinf(root.limits().processors));
    CHECK(root.limits().memory_bytes == std::numeric_limits<std::int64_t>::max());
}

TEST_CASE("A process uses at least one processor, and no more than it may", "[machine_limits]") {
    CHECK(usable_processors() >= 1);
    CHECK(usable_processors() <= std::max(1.0, std::ceil(control_group_limits().processors)));
    CHECK(usable_memory_bytes() > (64 << 20));
    CHECK(usable_memory_bytes() <= control_group_limits().memory_bytes);
}
