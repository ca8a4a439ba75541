#include <algorithm>

#include "apps/bench/study.h"
#include "apps/cases/stability/case.h"

/// The study of stability: float32 against float64 on stiff and extreme inputs.
namespace stymo {

namespace {

Row outcome_of(const StabilityCase& one) {
    const StabilityOutcome outcome = run_stability_case(one);
    double part = 0.0;  // of the bounds; 0 for a case without numbers
    const auto error = [&](const std::optional<double>& found, double bound) -> Value {
        if (!found) return {};
        if (bound > 0.0) part = std::max(part, *found / bound);
        return *found;
    };
    const Value value = error(outcome.value_error, one.value_bound);
    const Value gradient = error(outcome.gradient_error, one.gradient_bound);
    return {one.behaviour + (outcome.refusal.empty() ? "" : ": \"" + outcome.refusal + "\""),
            outcome.value_finite,
            outcome.gradient_finite,
            value,
            gradient,
            part,
            outcome.failure.empty() ? "yes" : "no: " + outcome.failure};
}

StudyPlan stability_plan(const StudyInputs&) {
    StudyPlan plan;
    for (const StabilityFamily& family : stability_families())
        for (const StabilityCase& one : family.cases())
            plan.add({family.name, one.name}, [one] { return outcome_of(one); });
    return plan;
}

Table passed_by_family(const Table& table) {
    Table result{"stability_summary", {"family", "cases", "passed", "worst"}};
    for (const StabilityFamily& family : stability_families()) {
        std::int64_t cases = 0, passed = 0;
        double worst = 0.0;
        for (const Row& row : table.rows) {
            if (words(table, row, "family") != family.name) continue;
            ++cases;
            passed += words(table, row, "passed") == "yes" ? 1 : 0;
            worst = std::max(worst, number(table, row, "error_over_bound"));
        }
        result.rows.push_back({family.name, cases, passed, worst});
    }
    return result;
}

}  // namespace

Study stability_study() {
    return {.part = "stability",
            .name = "stability",
            .title = "Stability",
            .varied = "stiff and extreme inputs, which float32 holds exactly",
            .measured =
                "largest |x32 - x64| / |x64| of any tensor, in the Euclidean norm, relative to the "
                "case's bound; numbers below float32's least normal number, 1.2e-38, do not count, "
                "and a case without an error is refused by an exception that names the tensor",
            .reference = "the same code in float64",
            .columns = {"~family", "case", "behaviour", "~value_finite", "~gradient_finite",
                        "value_error", "gradient_error", "error_over_bound", "passed"},
            .plan = stability_plan,
            .summary = passed_by_family,
            .seconds = 60.0};
}

}  // namespace stymo
