#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "core/work_counts.h"
#include "nn/realtime/face_renderer.h"

namespace stymo {

/// The option --explain: reports which networks were made, which losses were evaluated and how much
/// work was done since the construction of this object. The report goes to stderr after the work,
/// and into the result as "explain". Without the option it does nothing.
class Explainer {
public:
    explicit Explainer(bool wanted) : wanted_(wanted) {}

    [[nodiscard]] bool wanted() const { return wanted_; }
    /// Adds a count of the tool's own. Counts are reported in the order of the calls.
    void count(std::string name, std::int64_t number) {
        counts_.emplace_back(std::move(name), number);
    }
    /// Adds a renderer's counts of its last frame.
    void count(const RenderCounts& counts);
    /// Shows networks, losses and counts, and adds them to the result.
    void finish(AppResult& result);

private:
    bool wanted_;
    WorkMeter meter_;
    std::vector<std::pair<std::string, std::int64_t>> counts_;
};

/// The result of `work`, with a report of all that it did if that is wanted.
[[nodiscard]] AppResult explained(bool wanted, const std::function<AppResult()>& work);

void declare_explain(Command& command, bool& wanted);

}  // namespace stymo
