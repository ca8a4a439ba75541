#include <algorithm>

#include "apps/bench/study.h"
#include "apps/cases/stability/case.h"

/// The study of stability: float32 against float64 on stiff and extreme inputs.
namespace stymo {

namespace {

Value value_of(const std::optional<double>& error) {
    return error ? Value(*error) : Value();
}

/// Error over bound; 0 for a case without numbers.
double part_of_bound(const std::optional<double>& error, double bound) {
    return error && bound > 0.0 ? *error / bound : 0.0;
}

Row outcome_of(const StabilityCase& one) {
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
            .columns = {hidden("family"), "case", "behaviour", hidden("value_finite"),
                        hidden("gradient_finite"), "value_error", "gradient_error",
                        "error_over_bound", "passed"},
            .plan = stability_plan,
            .summary = passed_by_family,
            .seconds = 60.0};
}

}  // namespace stymo
