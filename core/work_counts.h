#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

/// Counts of the work that a program has done. The counts only grow, and no computation reads them,
/// so no result depends on them. They are therefore global to the process instead of a parameter of
/// every op.
namespace stymo {

struct WorkCounts {
    std::int64_t operations =
        0;  ///< ops evaluated, including those of gradients; a fused op counts once
    std::int64_t gradient_rules = 0;  ///< gradient rules evaluated, each for one input of an op
    std::int64_t gradients = 0;     ///< tensors that `grad` has found one for, in gradients within
                                    ///< gradients too; not zeros for what is not reached
    std::int64_t field_points = 0;  ///< points of space evaluated, including recomputed ones
    std::int64_t parameters = 0;    ///< tensors of trainable numbers created
    std::int64_t buffers = 0;       ///< tensor buffers allocated
    std::int64_t buffer_bytes = 0;  ///< bytes of all these buffers
    std::int64_t peak_bytes =
        0;  ///< of tensor buffers at one time, those included that were there at the beginning
    /// What the code above this folder counts under a name of its own, by group and name. What was
    /// not counted is missing.
    std::map<std::string, std::map<std::string, std::int64_t>> named{};
};

/// Counts from its construction on, on all threads. Meters may be nested. The peaks of meters that
/// overlap otherwise are unreliable.
class WorkMeter {
public:
    WorkMeter();
    ~WorkMeter();
    WorkMeter(const WorkMeter&) = delete;
    WorkMeter& operator=(const WorkMeter&) = delete;

    [[nodiscard]] WorkCounts counts() const;

private:
    WorkCounts begin_;
    std::int64_t peak_before_;
};

/// Called by the code that does the work, from any thread.
namespace work {

void count_operation();
void count_gradient_rule();
void count_gradients(std::int64_t tensors);
void count_field_points(std::int64_t points);
void count_parameter();
/// Locks, so it is for what happens at most some thousand times a second.
void count_named(std::string_view group, std::string_view name, std::int64_t amount);
void count_buffer(std::int64_t bytes);
void count_release(std::int64_t bytes);

}  // namespace work

}  // namespace stymo
