#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "core/work_counts.h"
#include "nn/models/realtime/face_renderer.h"

namespace stymo {

/// --explain: which networks were made, which losses were evaluated and how much was done, counted
/// where it happens. It goes to stderr after the work and into the result as "explain". The work
/// counts from the construction of this object on. Without the option it does nothing.
class Explainer {
public:
    explicit Explainer(bool wanted) : wanted_(wanted) {}

    [[nodiscard]] bool wanted() const { return wanted_; }
    /// Something that the tool counts itself, in the order of the calls.
    void count(std::string name, std::int64_t number) {
        counts_.emplace_back(std::move(name), number);
    }
    /// What a renderer counts of its last frame.
    void count(const RenderCounts& counts);
    /// Shows networks, losses and counts, and adds them to the result.
    void finish(AppResult& result);

private:
    bool wanted_;
    WorkMeter meter_;
    std::vector<std::pair<std::string, std::int64_t>> counts_;
};

void declare_explain(Command& command, bool& wanted);

}  // namespace stymo
