#include "cases/quadrature/quadrature.h"

#include <algorithm>
#include <cmath>

#include "apps/bench/study.h"
#include "apps/bench/timing.h"
#include "nn/models/radiance_field.h"

namespace stymo {

namespace {

constexpr std::size_t ray_count = 64;
constexpr std::int64_t most_samples = 4096;

/// Seconds for one sample of the paper's field, in the op that renders.
double time_of_field(std::uint64_t seed, int repeats) {
    constexpr std::int64_t rays = 1024, samples = 32;
    const RadianceFieldConfig config;
    Rng rng = Rng(seed).split("field");
    ParameterStore store;
    const RadianceField field(config, store, "field", rng);
    store.set_trainable("", false);
    const RayPoints points{.points = rng.uniform({1, rays * samples, 3}, -1.0, 1.0),
                           .deltas = Tensor::full({1, rays, samples}, 1.0 / samples)};
    const Variable style = rng.normal({1, config.style_size}, 0.0, 1.0);
    const Timing timing = time_repeated(repeats, 0.0, [&] {
        [[maybe_unused]] const RenderedRays out = field.render(points, style);
    });
    return timing.median() / static_cast<double>(rays * samples);
}

/// Every rule on every density with every number of samples.
Table measured(const StudyInputs& inputs, double seconds_per_sample) {
    const Rng rng = Rng(inputs.seed).split("quadrature");
    std::vector<StudyRow> rows;
    for (const ProfileFamily& family : profile_families())
        for (const QuadratureRule& rule : quadrature_rules())
            for (std::int64_t samples = 2; samples <= most_samples; samples *= 2)
                rows.push_back({{family.name, rule.name, samples}, [=]() -> Row {
                                    const auto rays = spread_rays(family, ray_count);
                                    const Intervals intervals = cut(rule, rays, samples, rng);
                                    const RayIntegral error =
                                        quadrature_error(integrate(rule, intervals), rays);
                                    return {static_cast<double>(samples) * seconds_per_sample,
                                            error.colour, error.transmittance};
                                }});
    return run_study({.name = "quadrature",
                      .columns = {{"profile"},
                                  {"rule"},
                                  {"samples"},
                                  {"seconds"},
                                  {"colour_error"},
                                  {"transmittance_error"}}},
                     rows);
}

/// The rows of one density and one rule.
Table curve_of(const Table& study, const std::string& profile, const std::string& rule) {
    Table curve{study.name, study.columns, {}};
    for (const Row& row : study.rows)
        if (study.words(row, "profile") == profile && study.words(row, "rule") == rule)
            curve.rows.push_back(row);
    return curve;
}

/// The smallest number of samples from which on the error stays below half of an 8-bit step, which
/// is invisible.
Value samples_needed(const Table& curve) {
    constexpr double visible = 1.0 / 512.0;
    Value needed = "> " + std::to_string(most_samples);
    for (auto row = curve.rows.rbegin();
         row != curve.rows.rend() && curve.number(*row, "colour_error") <= visible; ++row)
        needed = row->at(2);
    return needed;
}

Value order_of(const Table& curve, const char* error, double floor) {
    std::vector<double> errors;
    std::vector<std::int64_t> counts;
    for (const Row& row : curve.rows) {
        counts.push_back(std::get<std::int64_t>(row.at(2)));
        errors.push_back(curve.number(row, error));
    }
    // A smaller order is not convergence, but comes from structures that only some numbers of
    // samples resolve.
    constexpr double least_order = 0.2;
    const auto order = observed_order(counts, errors, floor);
    if (order && *order >= least_order) return *order;
    return errors.back() <= floor ? "reached" : "none";
}

Table convergence(const Table& study) {
    Table table{.name = "convergence",
                .columns = {{"profile", "density"},
                            {"rule", "rule"},
                            {"samples_needed", "N for 1/512"},
                            {"error_at_64", "error at N = 64"},
                            {"order_colour", "order of the colour", fixed<1>},
                            {"order_transmittance", "of the transmittance", fixed<1>}}};
    for (const ProfileFamily& family : profile_families())
        for (const QuadratureRule& rule : quadrature_rules()) {
            const Table curve = curve_of(study, family.name, rule.name);
            // Below it errors are round-off or, of the wall, the depth that light enters it.
            const double floor = rule.dtype == DType::float32 ? 1e-6 : 2e-8;
            const auto at_64 = std::ranges::find(curve.rows, Value(std::int64_t{64}),
                                                 [](const Row& row) { return row.at(2); });
            table.rows.push_back({family.name, rule.name, samples_needed(curve),
                                  curve.number(*at_64, "colour_error"),
                                  order_of(curve, "colour_error", floor),
                                  order_of(curve, "transmittance_error", floor)});
        }
    return table;
}

/// T_n = (1 - x)^n with x = sigma delta: negative for x > 1, unbounded for x > 2.
Table euler_table() {
    constexpr std::size_t steps = 64;
    Table table{.name = "euler",
                .columns = {{"optical_depth", "x"},
                            {"euler_1_step", "Euler, 1 step"},
                            {"euler", "Euler, 64 steps"},
                            {"exponential", "exponential, 64 steps"},
                            {"exact", "exp(-64 x)"}}};
    for (const double x : {0.5, 0.9, 1.1, 1.9, 2.1, 1e8}) {
        const auto transmittance = [&](std::size_t count, bool euler) {
            const std::vector<double> ones(count, 1.0);
            const QuadratureRule rule{.name = {}, .what = {}, .euler = euler};
            return integrate(rule, {1, std::vector<double>(count, x), ones, ones})
                .front()
                .transmittance;
        };
        table.rows.push_back({x, transmittance(1, true), transmittance(steps, true),
                              transmittance(steps, false), std::exp(-x * steps)});
    }
    return table;
}

void plot(Page& page, const Table& study, const std::string& profile) {
    Plot plot{.title = "Error of the colour: " + profile,
              .x_label = "time of a ray, µs",
              .y_label = "root mean square error over " + std::to_string(ray_count) + " rays",
              .series = {}};
    for (const QuadratureRule& rule : quadrature_rules()) {
        Table curve = curve_of(study, profile, rule.name);
        // Round-off has no curve, and Euler's errors have no bound.
        std::erase_if(curve.rows, [&](const Row& row) {
            const double error = curve.number(row, "colour_error");
            return !(error > 1e-15 && error <= 10.0);
        });
        plot = plot_of(
            curve, {.series = "rule", .x = "seconds", .y = "colour_error", .x_unit = 1e-6}, plot);
    }
    std::string name = "quadrature_colour_" + profile;
    std::ranges::replace(name, ' ', '_');
    page.plot(name, plot);
}

void write_quadrature(Page& page, const StudyInputs& inputs) {
    const double seconds_per_sample = time_of_field(inputs.seed, inputs.bench.repeats);
    const Table study = measured(inputs, seconds_per_sample);
    std::string lists;
    for (const ProfileFamily& family : profile_families())
        lists += "- Density \"" + family.name + "\": " + family.what + ".\n";
    for (const QuadratureRule& rule : quadrature_rules())
        lists += "- Rule \"" + rule.name + "\": " + rule.what + ".\n";
    page.text("Each density is one along a ray of length 1; " + std::to_string(ray_count) +
              " rays differ by where its structure lies. Colour and transmittance are "
              "known in closed form.\n\n" +
              lists);
    page.text("One sample of the paper's field takes " + decimal(seconds_per_sample * 1e6, 2) +
              " µs on the threads of this run. The time of a ray is N times that: the rules "
              "themselves take at most 2 % of it.");
    for (const ProfileFamily& family : profile_families()) plot(page, study, family.name);
    page.add(study);
    page.text(
        "\"N for 1/512\" is the number of samples from which on the colour's error stays "
        "below half of an 8-bit step. The order of convergence is the least-squares slope "
        "over N = 64 to 4096; \"reached\": the error is round-off too soon for a slope; "
        "\"none\": it does not converge.");
    page.add(convergence(study));
    page.text(
        "A slab of 64 steps, each with the optical depth x = sigma delta. Euler's "
        "transmittance is (1 - x)^n: negative for x > 1 and unbounded for x > 2. The "
        "exponential form stays in [0, 1] for every x.");
    page.add(euler_table());
}

}  // namespace

Study quadrature_study() {
    return {.name = "quadrature",
            .title = "Quadrature along a ray",
            .seconds = 60.0,
            .write = write_quadrature};
}

}  // namespace stymo
