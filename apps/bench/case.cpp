#include "apps/bench/case.h"

#include <algorithm>
#include <iterator>

#include "apps/common/command_line.h"
#include "core/error.h"

namespace stymo {

std::vector<BenchCase> bench_cases() {
    std::vector<BenchCase> all;
    for (auto& cases : {frame_cases(), step_cases(), kernel_cases()}) std::ranges::copy(cases, std::back_inserter(all));
    return all;
}

BenchCase case_named(const std::string& name) {
    const std::vector<BenchCase> all = bench_cases();
    const auto found = std::ranges::find(all, name, &BenchCase::name);
    if (found == all.end()) fail<UsageError>("there is no row ", name, "; stymo-bench rows lists them");
    return *found;
}

}  // namespace stymo
