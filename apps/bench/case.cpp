#include "apps/bench/case.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "apps/bench/peak.h"
#include "apps/common/command_line.h"
#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

Value share_of_peak(const Measurement& measurement) {
    if (measurement.limit == Limit::none || measurement.work <= 0.0) return {};
    double flops = measurement.timing.median_multiply_adds();
    if (measurement.limit == Limit::sixteen_bits) {
        const kernels::MachinePeak peak = kernels::measure_machine_peak();
        flops *=
            std::max(peak.bfloat16_multiply_adds, peak.float16_multiply_adds) / peak.multiply_adds;
    }
    if (flops <= 0.0) return {};
    return 2.0 * measurement.work / measurement.timing.median() / flops;
}

Value value_of(const std::optional<double>& number) {
    return number ? Value(*number) : Value();
}

std::string in_backquotes(const Value& name) {
    return "`" + plain(name) + "`";
}

}  // namespace

std::vector<BenchCase> bench_cases() {
    std::vector<BenchCase> all;
    for (const auto& cases : {frame_cases(), step_cases(), training_cases(), kernel_cases()})
        std::ranges::copy(cases, std::back_inserter(all));
    return all;
}

BenchCase case_named(const std::string& name) {
    const std::vector<BenchCase> all = bench_cases();
    const auto found = std::ranges::find(all, name, &BenchCase::name);
    if (found == all.end())
        fail<UsageError>("there is no row ", name, "; stymo-bench rows lists them");
    return *found;
}

std::vector<Column> case_columns() {
    return {{"name", "row", in_backquotes},
            {"what", "what"},
            {"threads"},
            {"median_seconds", "ms", milliseconds},
            {"minimum_seconds"},
            {"per_second", "a second", fixed<2>},
            {"share_of_peak", "of the peak", percent},
            {"psnr_mean_db", "PSNR dB", decibels},
            {"psnr_worst_db", "worst", decibels},
            {"equal_images"},
            {"peak_memory_mebibytes", "MiB", fixed<0>},
            {"remark", "remark"},
            {"peer_median_seconds", "peer ms", milliseconds},
            {"times_peer", "times peer", fixed<1>},
            {"peer_peak_memory_mebibytes"}};
}

Row measure_case(const BenchCase& bench_case, const BenchRun& run) {
    const Measurement measurement = bench_case.measure(run);
    const double seconds = measurement.timing.median();
    const bool equal = measurement.psnr_worst && std::isinf(*measurement.psnr_worst);
    return {static_cast<std::int64_t>(thread_count()),
            seconds,
            measurement.timing.minimum(),
            1.0 / seconds,
            share_of_peak(measurement),
            value_of(measurement.psnr_mean),
            value_of(measurement.psnr_worst),
            equal,
            measurement.peak_memory,
            measurement.remark,
            {},
            {},
            {}};
}

}  // namespace stymo
