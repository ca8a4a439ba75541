#pragma once

#include <cstdint>

/// What a program has done, counted where it is done. Counts only ever grow, and nothing that computes reads them, so no result
/// depends on them; that is why they may be the process's own and need not be handed through every op.
namespace stymo {

struct WorkCounts {
    std::int64_t operations = 0;      ///< ops evaluated, those of gradients included; a fused op counts once
    std::int64_t gradient_rules = 0;  ///< of ops, each for one of their inputs
    std::int64_t gradients = 0;       ///< tensors that `grad` has found one for, in gradients within gradients too; not zeros
                                      ///< for what is not reached
    std::int64_t field_points = 0;    ///< points through a network of sine layers, once more where it is computed once more
    std::int64_t parameters = 0;      ///< tensors that networks have made as their weights
    std::int64_t buffers = 0;         ///< of tensors, allocated
    std::int64_t buffer_bytes = 0;    ///< in all of these
    std::int64_t peak_bytes = 0;      ///< of tensor buffers at one time, those included that were there at the beginning
};

/// Counts from its making on, on all threads. Meters may be nested; of two that overlap otherwise, the peaks are not to be relied
/// upon.
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

/// For whoever does the work; any thread may call them.
namespace work {

void count_operation();
void count_gradient_rule();
void count_gradients(std::int64_t tensors);
void count_field_points(std::int64_t points);
void count_parameter();
void count_buffer(std::int64_t bytes);
void count_release(std::int64_t bytes);

}  // namespace work

}  // namespace stymo
