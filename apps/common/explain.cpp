#include "apps/common/explain.h"

#include <algorithm>
#include <array>
#include <iomanip>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "core/work_counts.h"

namespace stymo {

namespace {

using Counts = std::vector<std::pair<std::string, std::int64_t>>;

constexpr std::string_view own_counts = "tool", frame_counts = "last_frame";

/// The names of a renderer's counts in the report.
constexpr std::array<std::pair<const char*, std::int64_t RenderCounts::*>, 9> counts_of_a_frame{{
    {"samples_of_the_last_frame", &RenderCounts::samples},
    {"through_the_field", &RenderCounts::field_samples},
    {"points_of_the_grid", &RenderCounts::grid_points},
    {"tiles", &RenderCounts::tiles},
    {"pixels", &RenderCounts::pixels},
    {"pixels_computed", &RenderCounts::pixels_computed},
    {"layers", &RenderCounts::layers},
    {"layers_computed", &RenderCounts::layers_computed},
    {"foldings_of_weights", &RenderCounts::folds},
}};

/// The counts of a group, by name.
Counts named(const WorkCounts& work, std::string_view group) {
    const auto found = work.named.find(std::string(group));
    return found == work.named.end() ? Counts()
                                     : Counts(found->second.begin(), found->second.end());
}

Counts all_counts(const WorkCounts& work) {
    Counts counts = named(work, own_counts);
    // A frame has all of its counts, those of nothing too.
    if (const Counts frame = named(work, frame_counts); !frame.empty()) {
        for (const auto& [name, member] : counts_of_a_frame) {
            const auto same = [&name](const auto& count) { return count.first == name; };
            const auto found = std::ranges::find_if(frame, same);
            counts.emplace_back(name, found == frame.end() ? 0 : found->second);
        }
    }
    for (const auto& count : named(work, "evaluations")) counts.push_back(count);
    counts.insert(counts.end(), {{"operations", work.operations},
                                 {"gradient_rules", work.gradient_rules},
                                 {"gradients", work.gradients},
                                 {"field_points", work.field_points},
                                 {"parameters_made", work.parameters},
                                 {"buffers", work.buffers},
                                 {"buffer_bytes", work.buffer_bytes},
                                 {"peak_bytes", work.peak_bytes}});
    return counts;
}

/// Prints and returns a list of names with numbers.
JsonValue shown(const std::string& title, const Counts& counts, std::ostream& err) {
    err << title << '\n';
    JsonValue object = JsonValue::object();
    for (const auto& [name, number] : counts) {
        std::string words = name;
        std::ranges::replace(words, '_', ' ');
        err << "  " << std::left << std::setw(30) << words << std::right << std::setw(16) << number
            << '\n';
        object.add(name, number);
    }
    return object;
}

}  // namespace

AppResult explained(const std::function<AppResult()>& work, std::ostream& err) {
    const WorkMeter meter;
    AppResult result = work();
    const WorkCounts done = meter.counts();
    const JsonValue networks =
        shown("networks made, with their number of weights", named(done, "networks"), err);
    const JsonValue losses =
        shown("terms of the loss, with the number of evaluations", named(done, "loss_terms"), err);
    const JsonValue counts = shown("counts", all_counts(done), err);
    result.json.add(
        "explain",
        JsonValue::object({{"networks", networks}, {"loss_terms", losses}, {"counts", counts}}));
    return result;
}

void count_for_report(std::string_view name, std::int64_t number) {
    work::count_named(own_counts, name, number);
}

void count_for_report(const RenderCounts& counts) {
    for (const auto& [name, member] : counts_of_a_frame)
        work::count_named(frame_counts, name, counts.*member);
}

}  // namespace stymo
