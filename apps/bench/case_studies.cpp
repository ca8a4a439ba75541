#include <algorithm>
#include <cmath>

#include "apps/bench/study.h"
#include "apps/cases/quadrature/quadrature.h"
#include "apps/cases/stability/case.h"
#include "nn/models/radiance_field.h"

/// Studies on the cases of apps/cases.
namespace stymo {

namespace {

constexpr std::size_t ray_count = 64;
constexpr std::int64_t most_samples = 4096;
constexpr std::int64_t usual_samples = 64;

/// Seconds for one sample of the paper's field, in the op that renders.
double time_of_field(const BenchOptions& options) {
    constexpr std::int64_t rays = 1024, samples = 32;
    const RadianceFieldConfig config;
    Rng rng = Rng(options.seed).split("field");
    ParameterStore store;
    const RadianceField field(config, store, "field", rng);
    store.set_trainable("", false);
    const RayPoints points{.points = rng.uniform({1, rays * samples, 3}, -1.0, 1.0),
                           .deltas = Tensor::full({1, rays, samples}, 1.0 / samples)};
    const Variable style = rng.normal({1, config.style_size}, 0.0, 1.0);
    const Timing timing = time_repeated(options.repeats, 0.0, [&] {
        [[maybe_unused]] const RenderedRays out = field.render(points, style);
    });
    return timing.median() / static_cast<double>(rays * samples);
}

Value order_of(const std::vector<std::int64_t>& counts, const std::vector<double>& errors,
               double floor) {
    // A smaller order is not convergence, but comes from structures that only some numbers of
    // samples resolve.
    constexpr double least_order = 0.2;
    const auto order = observed_order(counts, errors, floor);
    if (order && *order >= least_order) return *order;
    return errors.back() <= floor ? "reached" : "none";
}

/// One rule on one density with every number of samples; the errors go to `curves`.
Row convergence(const ProfileFamily& family, const QuadratureRule& rule, const Rng& rng,
                double seconds_per_sample, Table& curves) {
    // Half of an 8-bit step.
    constexpr double visible = 1.0 / 512.0;
    const auto rays = spread_rays(family, ray_count);
    std::vector<std::int64_t> counts;
    std::vector<double> colours, transmittances;
    Value needed, error_at_64;
    bool invisible = false;
    for (std::int64_t samples = 2; samples <= most_samples; samples *= 2) {
        const RayIntegral error =
            quadrature_error(integrate(rule, cut(rule, rays, samples, rng)), rays);
        counts.push_back(samples);
        colours.push_back(error.colour);
        transmittances.push_back(error.transmittance);
        if (error.colour <= visible && !invisible) needed = samples;
        invisible = error.colour <= visible;
        if (samples == usual_samples) error_at_64 = error.colour;
        curves.rows.push_back({family.name, rule.name, samples,
                               static_cast<double>(samples) * seconds_per_sample, error.colour,
                               error.transmittance});
    }
    if (!invisible) needed = "> " + std::to_string(most_samples);
    // Below it errors are round-off or, of the wall, the depth that light enters it.
    const double floor = rule.dtype == DType::float32 ? 1e-6 : 2e-8;
    return {needed, error_at_64, order_of(counts, colours, floor),
            order_of(counts, transmittances, floor)};
}

StudyPlan quadrature_plan(const StudyInputs& inputs) {
    const Rng rng = Rng(inputs.bench.seed).split("quadrature");
    const double seconds_per_sample = time_of_field(inputs.bench);
    StudyPlan plan;
    plan.curves = std::make_shared<Table>(
        Table{"quadrature",
              {"profile", "rule", "samples", "seconds", "colour_error", "transmittance_error"}});
    for (const ProfileFamily& family : profile_families())
        for (const QuadratureRule& rule : quadrature_rules())
            plan.add({family.name, rule.name}, [=, curves = plan.curves] {
                return convergence(family, rule, rng, seconds_per_sample, *curves);
            });
    plan.setting = "One sample of the paper's field takes " +
                   significant(seconds_per_sample * 1e6, 3) +
                   " µs on the threads of this run; the rules themselves take at most 2 % of it.";
    for (const ProfileFamily& family : profile_families())
        plan.setting += "\n- Density \"" + family.name + "\": " + family.what + ".";
    for (const QuadratureRule& rule : quadrature_rules())
        plan.setting += "\n- Rule \"" + rule.name + "\": " + rule.what + ".";
    return plan;
}

}  // namespace

Study quadrature_study() {
    return {.part = "quadrature",
            .name = "convergence",
            .title = "Quadrature along a ray",
            .varied = "density along a ray of length 1, rule, 2 to 4096 samples N; " +
                      std::to_string(ray_count) + " rays differ by where the structure lies",
            .measured =
                "N from which on the colour's error is at most half of an 8-bit step, error at "
                "64, and the order of convergence over N = 64 to 4096 (\"reached\": round-off "
                "too soon for a slope; \"none\": it does not converge)",
            .reference = "the integrals in closed form",
            .columns = {"profile", "rule", "samples_needed", "error_at_64", "order_colour",
                        "order_transmittance"},
            .plan = quadrature_plan,
            .seconds = 60.0};
}

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
