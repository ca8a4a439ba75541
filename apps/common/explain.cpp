#include "apps/common/explain.h"

#include <algorithm>
#include <iomanip>
#include <iostream>

namespace stymo {

namespace {

/// Prints and returns a list of names with numbers.
template <class Numbers>
JsonValue shown(const std::string& title, const Numbers& numbers) {
    std::cerr << title << '\n';
    JsonValue object = JsonValue::object();
    for (const auto& [name, number] : numbers) {
        std::string words = name;
        std::ranges::replace(words, '_', ' ');
        std::cerr << "  " << std::left << std::setw(30) << words << std::right << std::setw(16)
                  << number << '\n';
        object.add(name, number);
    }
    return object;
}

}  // namespace

void Explainer::count(const RenderCounts& counts) {
    count("samples_of_the_last_frame", counts.samples);
    count("through_the_field", counts.field_samples);
    count("points_of_the_grid", counts.grid_points);
    count("tiles", counts.tiles);
    count("pixels", counts.pixels);
    count("pixels_computed", counts.pixels_computed);
    count("layers", counts.layers);
    count("layers_computed", counts.layers_computed);
    count("foldings_of_weights", counts.folds);
}

void Explainer::finish(AppResult& result) {
    if (!wanted_) return;
    const WorkCounts work = meter_.counts();
    const auto named = [&](const std::string& group) {
        const auto found = work.named.find(group);
        return found == work.named.end() ? std::map<std::string, std::int64_t>{} : found->second;
    };
    for (const auto& [name, number] : named("evaluations")) count(name, number);
    count("operations", work.operations);
    count("gradient_rules", work.gradient_rules);
    count("gradients", work.gradients);
    count("field_points", work.field_points);
    count("parameters_made", work.parameters);
    count("buffers", work.buffers);
    count("buffer_bytes", work.buffer_bytes);
    count("peak_bytes", work.peak_bytes);
    const JsonValue networks =
        shown("networks made, with their number of weights", named("networks"));
    const JsonValue losses =
        shown("terms of the loss, with the number of evaluations", named("loss_terms"));
    result.json.add("explain", JsonValue::object({{"networks", networks},
                                                  {"loss_terms", losses},
                                                  {"counts", shown("counts", counts_)}}));
}

AppResult explained(bool wanted, const std::function<AppResult()>& work) {
    Explainer explainer(wanted);
    AppResult result = work();
    explainer.finish(result);
    return result;
}

void declare_explain(Command& command, bool& wanted) {
    command
        .flag("--explain", wanted,
              "print on stderr which networks were made, which losses were evaluated, and counts "
              "of the work done; also in --json")
        .keeps_results();
}

}  // namespace stymo
