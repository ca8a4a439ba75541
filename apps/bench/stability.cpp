#include <algorithm>
#include <cmath>

#include "apps/bench/study.h"
#include "cases/stability/case.h"

namespace stymo {

namespace {

struct Family {
    std::string name;
    std::vector<StabilityCase> cases;
};

std::vector<Family> families() {
    using namespace stability;
    return {
        {"rays", ray_cases()},     {"cameras", camera_cases()}, {"activations", activation_cases()},
        {"layers", layer_cases()}, {"losses", loss_cases()},    {"training", training_cases()}};
}

Value value_of(const std::optional<double>& error) {
    return error ? Value(*error) : Value();
}

/// Error over bound; 0 for a case without numbers.
double part_of_bound(const std::optional<double>& error, double bound) {
    return error && bound > 0.0 ? *error / bound : 0.0;
}

Row measured(const StabilityCase& one) {
    const StabilityOutcome outcome = run_stability_case(one);
    return {one.behaviour + (outcome.refusal.empty() ? "" : ": \"" + outcome.refusal + "\""),
            outcome.value_finite,
            outcome.gradient_finite,
            value_of(outcome.value_error),
            value_of(outcome.gradient_error),
            std::max(part_of_bound(outcome.value_error, one.value_bound),
                     part_of_bound(outcome.gradient_error, one.gradient_bound)),
            outcome.failure.empty() ? "yes" : "no: " + outcome.failure};
}

void write_stability(Page& page, const StudyInputs&) {
    std::vector<StudyRow> rows;
    for (const Family& family : families())
        for (const StabilityCase& one : family.cases)
            rows.push_back({{family.name, one.name}, [one] { return measured(one); }});
    const Table table = run_study({.name = "stability",
                                   .columns = {{"family"},
                                               {"case", "case"},
                                               {"behaviour", "what the code does"},
                                               {"value_finite"},
                                               {"gradient_finite"},
                                               {"value_error", "error"},
                                               {"gradient_error", "of the gradient"},
                                               {"error_over_bound", "error / bound", fixed<2>},
                                               {"passed", "passed"}}},
                                  rows);
    Table summary{.name = "stability_summary",
                  .columns = {{"family", "cases on"},
                              {"cases", "cases"},
                              {"passed", "passed"},
                              {"worst", "largest error / bound", fixed<2>}}};
    for (const Family& family : families()) {
        std::int64_t passed = 0;
        double worst = 0.0;
        for (const Row& row : table.rows) {
            if (table.words(row, "family") != family.name) continue;
            passed += table.words(row, "passed") == "yes" ? 1 : 0;
            worst = std::max(worst, table.number(row, "error_over_bound"));
        }
        summary.rows.push_back({family.name, std::ssize(family.cases), passed, worst});
    }
    page.text(
        "The same code in float32 and in float64, on inputs that float32 holds exactly. The "
        "error is |x32 - x64| / |x64| of the worst tensor of a case, in the Euclidean norm; "
        "numbers below float32's least normal number, 1.2e-38, do not count. A case without "
        "an error is refused by an exception that names the tensor. The cases are also "
        "tests, in `tests/cases/stability`.");
    page.add(summary);
    page.add(table);
}

}  // namespace

Study stability_study() {
    return {.name = "stability", .title = "Stability", .seconds = 60.0, .write = write_stability};
}

}  // namespace stymo
