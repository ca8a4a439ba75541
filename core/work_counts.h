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
    /// Ops evaluated, including those of gradients; a fused op counts once.
    std::int64_t operations = 0;
    std::int64_t gradient_rules = 0;  ///< gradient rules evaluated, each for one input of an op
    /// Tensors for which `grad` computed a gradient, in nested gradients too. Zeros for tensors
    /// that y does not depend on are not counted.
    std::int64_t gradients = 0;
    /// Points at which a field was evaluated, including recomputed ones.
    std::int64_t field_points = 0;
    std::int64_t parameters = 0;    ///< parameter tensors created
    std::int64_t buffers = 0;       ///< tensor buffers allocated
    std::int64_t buffer_bytes = 0;  ///< bytes of all these buffers
    /// Largest total size of the tensor buffers at one time, including those that existed at the
    /// beginning.
    std::int64_t peak_bytes = 0;
    /// Counts of code outside core, by group and name. Names that were never counted are missing.
    std::map<std::string, std::map<std::string, std::int64_t>> named{};
};

/// Counts the work on all threads since its construction. Meters may be nested. The peaks of meters
/// that overlap without being nested are unreliable.
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

/// Functions for the code that does the work. They may be called from any thread.
namespace work {

void count_operation();
void count_gradient_rule();
void count_gradients(std::int64_t tensors);
void count_field_points(std::int64_t points);
void count_parameter();
/// Takes a lock, so it should be called at most some thousand times a second.
void count_named(std::string_view group, std::string_view name, std::int64_t amount);
void count_buffer(std::int64_t bytes);
void count_release(std::int64_t bytes);

}  // namespace work

}  // namespace stymo
