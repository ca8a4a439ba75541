#include "apps/bench/report/stability.h"

#include <sstream>

#include "apps/bench/report/stability_case.h"

namespace stymo {

namespace {

ReportCell finite_cell(bool any, bool finite) {
    if (!any) return {"", JsonValue()};
    return {finite ? "yes" : "no", JsonValue(finite)};
}

ReportCell error_cell(const std::optional<double>& error) {
    return error ? ReportCell(*error) : ReportCell("", JsonValue());
}

std::string bound_text(const StabilityCase& row, const StabilityOutcome& outcome) {
    std::ostringstream text;
    if (outcome.value_error) text << row.value_bound;
    if (outcome.gradient_error) text << " / " << row.gradient_bound;
    return text.str();
}

std::vector<ReportCell> cells_of(const StabilityCase& row, const StabilityOutcome& outcome) {
    const bool refused = !outcome.refusal.empty();
    const std::string behaviour = refused ? row.behaviour + ": \"" + outcome.refusal + "\"" : row.behaviour;
    return {row.name,
            finite_cell(!refused, outcome.value_finite),
            finite_cell(outcome.gradient_error.has_value() || !outcome.gradient_finite, outcome.gradient_finite),
            error_cell(outcome.value_error),
            error_cell(outcome.gradient_error),
            bound_text(row, outcome),
            behaviour,
            outcome.failure.empty() ? "yes" : "no: " + outcome.failure};
}

void write_stability(ReportWriter& report, const ReportInputs&) {
    report.text(
        "The same code in float32 and in float64 on inputs that float32 holds exactly. The error is |x32 - x64| / |x64| of the "
        "worst "
        "tensor of a case, values and gradients apart, in the Euclidean norm; the bound is that of the value / of the gradient. "
        "What "
        "is smaller than float32's least normal number, 1.2e-38, does not count. A case without numbers is refused: its error "
        "names "
        "the tensor. Each row is a test of `tests/apps`.");
    std::vector<std::vector<ReportCell>> rows;
    std::int64_t held = 0;
    for (const StabilityCase& row : stability_cases()) {
        const StabilityOutcome outcome = run_stability_case(row);
        held += outcome.failure.empty() ? 1 : 0;
        rows.push_back(cells_of(row, outcome));
    }
    report.table("stability",
                 {"case", "forward finite", "gradient finite", "error forward", "error gradient", "bound", "what the code does",
                  "as it should be"},
                 rows);
    report.text(std::to_string(held) + " of " + std::to_string(rows.size()) + " cases are as they should be.");
}

}  // namespace

ReportSection stability_section() {
    return {.name = "stability", .title = "Stability", .seconds = 60.0, .write = write_stability};
}

}  // namespace stymo
