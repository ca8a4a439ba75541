#pragma once

#include <string>
#include <vector>

#include "apps/bench/report.h"
#include "apps/bench/subject.h"

namespace stymo {

/// An exact frame with one quantity varied; time and work relative to the first value of that quantity.
struct GrowthPoint {
    std::string varied;
    std::int64_t value = 0;
    double seconds = 0.0;  ///< median
    double multiply_adds = 0.0;
    double times_time = 1.0;
    double times_work = 1.0;
};

/// How the cost of an exact frame grows with samples (16 to 256), size (64 up to the model's), width of the field (half to one
/// and a half of the model's, random weights), threads (1 up to those in use, by doubling; the work of each thread counts).
[[nodiscard]] std::vector<GrowthPoint> measure_growth(const BenchSubject& subject, const BenchOptions& options,
                                                      std::uint64_t seed);
[[nodiscard]] Cells growth_cells(const std::vector<GrowthPoint>& points);
[[nodiscard]] JsonValue to_json(const std::vector<GrowthPoint>& points);

}  // namespace stymo
