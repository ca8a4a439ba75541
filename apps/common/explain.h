#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "core/work_counts.h"

namespace stymo {

/// A module that is made or not, or a loss or gradient that is computed or not.
struct PlannedPart {
    std::string name;
    bool used = false;
    std::string remark;  ///< its size, or why it is left out
};

/// What a tool sets out to do.
struct WorkPlan {
    std::vector<PlannedPart> modules;
    std::vector<PlannedPart> computed;  ///< losses, gradients
};

/// --explain: the plan goes to stderr before the work, what was counted behind it, and both into the result as "explain". The
/// work counts from the making of this object on. Without the option it is mute.
class Explainer {
public:
    explicit Explainer(bool wanted) : wanted_(wanted) {}

    [[nodiscard]] bool wanted() const { return wanted_; }
    /// Shows the plan; once, before the work.
    void show(WorkPlan plan);
    /// Something that the tool counts itself, in the order of the calls.
    void count(std::string name, std::int64_t number) { counts_.emplace_back(std::move(name), number); }
    /// Shows the counts and adds all to the result.
    void finish(AppResult& result);

private:
    bool wanted_;
    WorkMeter meter_;
    WorkPlan plan_;
    std::vector<std::pair<std::string, std::int64_t>> counts_;
};

void declare_explain(Command& command, bool& wanted);

[[nodiscard]] std::string to_text(const WorkPlan& plan);
[[nodiscard]] JsonValue to_json(const WorkPlan& plan);
/// Names as in JSON, with what is counted.
[[nodiscard]] std::vector<std::pair<std::string, std::int64_t>> named(const WorkCounts& counts);

}  // namespace stymo
