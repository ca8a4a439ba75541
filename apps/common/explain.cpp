#include "apps/common/explain.h"

#include <algorithm>
#include <iomanip>
#include <iostream>
#include <sstream>

namespace stymo {

namespace {

using NamedCounts = std::vector<std::pair<std::string, std::int64_t>>;

std::string parts_text(const std::vector<PlannedPart>& parts, const char* used, const char* unused) {
    std::ostringstream text;
    for (const PlannedPart& part : parts) {
        text << "  " << std::left << std::setw(12) << (part.used ? used : unused) << part.name;
        if (!part.remark.empty()) text << ": " << part.remark;
        text << '\n';
    }
    return text.str();
}

JsonValue parts_json(const std::vector<PlannedPart>& parts, const char* used) {
    std::vector<JsonValue> objects;
    for (const PlannedPart& part : parts)
        objects.push_back(JsonValue::object({{"name", part.name}, {used, part.used}, {"remark", part.remark}}));
    return objects;
}

/// "gradient_rules" as "gradient rules".
std::string in_words(std::string name) {
    std::ranges::replace(name, '_', ' ');
    return name;
}

std::string counts_text(const NamedCounts& counts) {
    std::ostringstream text;
    for (const auto& [name, number] : counts)
        text << "  " << std::left << std::setw(20) << in_words(name) << std::right << std::setw(16) << number << '\n';
    return text.str();
}

JsonValue counts_json(const NamedCounts& counts) {
    JsonValue object = JsonValue::object();
    for (const auto& [name, number] : counts) object.add(name, number);
    return object;
}

}  // namespace

std::vector<std::pair<std::string, std::int64_t>> named(const WorkCounts& counts) {
    return {{"operations", counts.operations},     {"gradient_rules", counts.gradient_rules}, {"gradients", counts.gradients},
            {"field_points", counts.field_points}, {"parameters_made", counts.parameters},    {"buffers", counts.buffers},
            {"buffer_bytes", counts.buffer_bytes}, {"peak_bytes", counts.peak_bytes}};
}

std::string to_text(const WorkPlan& plan) {
    return "plan\n" + parts_text(plan.modules, "made", "not made") + parts_text(plan.computed, "computed", "left out");
}

JsonValue to_json(const WorkPlan& plan) {
    return JsonValue::object(
        {{"modules", parts_json(plan.modules, "made")}, {"computed", parts_json(plan.computed, "computed")}});
}

void Explainer::show(WorkPlan plan) {
    plan_ = std::move(plan);
    if (wanted_) std::cerr << to_text(plan_) << std::flush;
}

void Explainer::finish(AppResult& result) {
    if (!wanted_) return;
    std::ranges::copy(named(meter_.counts()), std::back_inserter(counts_));
    std::cerr << "counts\n" << counts_text(counts_) << std::flush;
    JsonValue object = to_json(plan_);
    object.add("counts", counts_json(counts_));
    result.json.add("explain", object);
}

void declare_explain(Command& command, bool& wanted) {
    command.flag("--explain", wanted,
                 "say on stderr what is made, computed and left out, and behind the work how much was done; also in --json");
}

}  // namespace stymo
