#include "apps/bench/report/quadrature.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "apps/bench/report.h"
#include "apps/bench/timing.h"
#include "core/dtype.h"
#include "nn/models/radiance_field.h"

namespace stymo {

namespace {

constexpr std::size_t ray_count = 64;
constexpr std::int64_t most_samples = 4096;
/// Half of an 8-bit step.
constexpr double visible = 1.0 / 512.0;

/// Below it errors are round-off or, of the wall, the depth that light enters it.
double least_error(DType dtype) {
    return dtype == DType::float32 ? 1e-6 : 2e-8;
}

/// One rule with one number of samples on the rays of one family.
struct QuadraturePoint {
    std::int64_t samples = 0;
    double evaluations = 0.0;  ///< on a ray
    double seconds = 0.0;      ///< for a ray
    QuadratureError error;
};

struct QuadratureCurve {
    std::size_t rule = 0;
    std::size_t family = 0;
    std::vector<QuadraturePoint> points;
};

/// All there is to show.
struct QuadratureStudy {
    std::vector<ProfileFamily> families = profile_families();
    std::vector<QuadratureRule> rules = quadrature_rules();
    double seconds_per_evaluation = 0.0;
    std::vector<std::vector<double>> overhead;  ///< seconds for a ray, by rule and number of samples
    std::vector<QuadratureCurve> curves;
};

std::vector<std::int64_t> sample_counts() {
    std::vector<std::int64_t> counts;
    for (std::int64_t samples = 2; samples <= most_samples; samples *= 2) counts.push_back(samples);
    return counts;
}

/// One sample of the paper's field, in the op that renders.
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
    const Timing timing =
        time_repeated(repeats, 0.0, [&] { [[maybe_unused]] const RenderedRays out = field.render(points, style); });
    return timing.median() / static_cast<double>(rays * samples);
}

std::vector<std::vector<double>> time_of_rules(const std::vector<QuadratureRule>& rules, const Rng& rng, int repeats) {
    // A density that costs next to nothing, so that what is timed is the rule.
    const std::vector<RayProfile> rays = spread_rays(profile_families().front(), ray_count);
    std::vector<std::vector<double>> seconds;
    for (const QuadratureRule& rule : rules) {
        seconds.emplace_back();
        for (const std::int64_t samples : sample_counts()) {
            const Timing timing = time_repeated(repeats, 0.0, [&] {
                [[maybe_unused]] const RayResults out = composited(rule.cut(rays, samples, rng), rule, false);
            });
            seconds.back().push_back(timing.median() / static_cast<double>(ray_count));
        }
    }
    return seconds;
}

QuadratureStudy measured(const ReportInputs& inputs) {
    const Rng rng = Rng(inputs.seed).split("quadrature");
    QuadratureStudy study;
    study.seconds_per_evaluation = time_of_field(inputs.seed, inputs.bench.repeats);
    study.overhead = time_of_rules(study.rules, rng, inputs.bench.repeats);
    const std::vector<std::int64_t> counts = sample_counts();
    for (std::size_t family = 0; family < study.families.size(); ++family) {
        const std::vector<RayProfile> rays = spread_rays(study.families[family], ray_count);
        for (std::size_t rule = 0; rule < study.rules.size(); ++rule) {
            QuadratureCurve curve{rule, family, {}};
            for (std::size_t i = 0; i < counts.size(); ++i) {
                const CutRays cut = study.rules[rule].cut(rays, counts[i], rng);
                const double evaluations = static_cast<double>(cut.evaluations) / static_cast<double>(ray_count);
                const double seconds = evaluations * study.seconds_per_evaluation + study.overhead[rule][i];
                const RayResults results = composited(cut, study.rules[rule], true);
                curve.points.push_back({counts[i], evaluations, seconds, quadrature_error(results, rays)});
            }
            study.curves.push_back(std::move(curve));
        }
    }
    return study;
}

const QuadratureCurve& curve_of(const QuadratureStudy& study, std::size_t rule, std::size_t family) {
    return study.curves[family * study.rules.size() + rule];
}

/// A row for each rule, a column for each family.
void write_grid(ReportWriter& report, const QuadratureStudy& study, const std::string& name,
                const std::function<ReportCell(const QuadratureRule&, const QuadratureCurve&)>& cell) {
    std::vector<std::string> columns{"rule"};
    for (const ProfileFamily& family : study.families) columns.push_back(family.name);
    std::vector<std::vector<ReportCell>> rows;
    for (std::size_t rule = 0; rule < study.rules.size(); ++rule) {
        rows.push_back({study.rules[rule].name});
        for (std::size_t family = 0; family < study.families.size(); ++family)
            rows.back().push_back(cell(study.rules[rule], curve_of(study, rule, family)));
    }
    report.table(name, columns, rows);
}

/// The three things that have errors.
struct Quantity {
    const char* name;
    const char* words;
    double QuadratureError::*error;
};
constexpr Quantity quantities[] = {{"colour", "the colour", &QuadratureError::colour},
                                   {"transmittance", "the transmittance", &QuadratureError::transmittance},
                                   {"gradient", "d colour / d log density", &QuadratureError::colour_by_log_density}};

ReportCell order_cell(const QuadratureRule& rule, const QuadratureCurve& curve, double QuadratureError::*quantity) {
    std::vector<double> errors;
    std::vector<std::int64_t> counts;
    for (const QuadraturePoint& point : curve.points) {
        counts.push_back(point.samples);
        errors.push_back(point.error.*quantity);
    }
    const double floor = least_error(rule.dtype), last = errors.back();
    // Less is no convergence, but a structure that a few of the numbers of samples meet.
    constexpr double least_order = 0.2, rounding = 1e-13;
    const auto order = observed_order(counts, errors, floor);
    if (order && *order >= least_order) return {decimal(*order, 1), *order};
    return {last <= rounding ? "exact" : last <= floor ? "reached" : "none", JsonValue()};
}

ReportCell need_cell(const QuadratureCurve& curve) {
    // The least number from which on no larger one does worse: a lucky small one does not count.
    const QuadraturePoint* enough = nullptr;
    for (auto point = curve.points.rbegin(); point != curve.points.rend() && point->error.colour <= visible; ++point)
        enough = &*point;
    if (enough == nullptr) return {"> " + std::to_string(most_samples), JsonValue()};
    return {decimal(enough->evaluations, 0) + " (" + decimal(enough->seconds * 1e6, 0) + " µs)", enough->evaluations};
}

void write_plot(ReportWriter& report, const QuadratureStudy& study, std::size_t family, const Quantity& quantity) {
    const std::string& profile = study.families[family].name;
    Plot plot{.title = "Error of " + std::string(quantity.words) + ": " + profile,
              .x_label = "time of a ray, µs",
              .y_label = "root mean square error over " + std::to_string(ray_count) + " rays",
              .series = {}};
    for (std::size_t rule = 0; rule < study.rules.size(); ++rule) {
        PlotSeries series{study.rules[rule].name, {}, rule};
        for (const QuadraturePoint& point : curve_of(study, rule, family).points) {
            // Round-off has no curve, and Euler leaves every scale.
            const double error = point.error.*quantity.error;
            if (!(error > 1e-15) || !(error <= 10.0)) continue;
            const bool marked = point.samples == 64;
            series.points.push_back({point.seconds * 1e6, error, marked && rule == 0 ? "N = 64" : ""});
        }
        if (!series.points.empty()) plot.series.push_back(std::move(series));
    }
    if (2 * plot.series.size() < study.rules.size()) {
        std::string others;
        for (const PlotSeries& series : plot.series) others += (others.empty() ? "" : ", ") + series.name;
        report.text("No plot of " + std::string(quantity.words) + " for " + profile + ": every rule is exact there" +
                    (others.empty() ? "." : " but " + others + "."));
        return;
    }
    std::string file = "quadrature_" + std::string(quantity.name) + "_" + profile;
    std::ranges::replace(file, ' ', '_');
    report.plot(file, plot);
}

void write_rules(ReportWriter& report, const QuadratureStudy& study) {
    std::vector<std::vector<ReportCell>> profiles, rules;
    for (const ProfileFamily& family : study.families) profiles.push_back({family.name, family.what});
    constexpr std::size_t at_64 = 5;
    for (std::size_t rule = 0; rule < study.rules.size(); ++rule)
        rules.push_back({study.rules[rule].name, study.rules[rule].what, study.overhead[rule][at_64] * 1e6});
    report.text(
        "Each density is one along a ray of length 1; " + std::to_string(ray_count) +
        " rays differ by where its structure lies. Between jumps the colour rises linearly, with the distance or with the "
        "optical depth, so that colour, transmittance and gradient are known in closed form.");
    report.table("quadrature_profiles", {"profile", "density along the ray"}, profiles);
    report.text(
        "A sample of the paper's field costs " + decimal(study.seconds_per_evaluation * 1e6, 2) +
        " µs on the threads of this run, measured in the op that renders. The time of a ray is its evaluations times that, "
        "plus the time of the rule itself, measured apart on as many rays.");
    report.table("quadrature_rules", {"rule", "what", "µs a ray at N = 64, without the field"}, rules);
}

void write_curves(ReportWriter& report, const QuadratureStudy& study) {
    std::vector<std::vector<ReportCell>> rows;
    for (const QuadratureCurve& curve : study.curves)
        for (const QuadraturePoint& point : curve.points)
            rows.push_back({study.families[curve.family].name, study.rules[curve.rule].name, point.samples, point.evaluations,
                            point.seconds, point.error.colour, point.error.transmittance, point.error.colour_by_log_density});
    report.heading("Error against time");
    for (std::size_t family = 0; family < study.families.size(); ++family) write_plot(report, study, family, quantities[0]);
    for (std::size_t family = 0; family < study.families.size(); ++family) {
        const bool typical = study.families[family].name == "blob" || study.families[family].name == "two surfaces";
        if (typical)
            for (const Quantity& quantity : std::span(quantities).subspan(1)) write_plot(report, study, family, quantity);
    }
    report.data("quadrature",
                {"profile", "rule", "samples", "evaluations", "seconds", "colour_error", "transmittance_error", "gradient_error"},
                rows);
}

void write_orders(ReportWriter& report, const QuadratureStudy& study) {
    report.heading("What is needed for an error of half an 8-bit step");
    report.text("The least evaluations on a ray, with their time, from which on the colour's error stays below 1/512.");
    write_grid(report, study, "quadrature_needed",
               [](const QuadratureRule&, const QuadratureCurve& curve) { return need_cell(curve); });
    report.heading("Errors of the colour at N = 64");
    write_grid(report, study, "quadrature_at_64", [](const QuadratureRule&, const QuadratureCurve& curve) {
        return ReportCell(std::ranges::find(curve.points, 64, &QuadraturePoint::samples)->error.colour);
    });
    report.heading("Observed order of convergence");
    report.text(
        "Least squares over N = 64 to 4096 without errors below 2e-8 (1e-6 in float32) and above 1. \"exact\": there is but "
        "round-off; \"reached\": these bounds are reached too soon for an order; \"none\": it does not converge.");
    for (const Quantity& quantity : quantities) {
        report.text("Of " + std::string(quantity.words) + ":");
        write_grid(
            report, study, "quadrature_order_" + std::string(quantity.name),
            [&](const QuadratureRule& rule, const QuadratureCurve& curve) { return order_cell(rule, curve, quantity.error); });
    }
}

/// T_n = (1 - x)^n with x = sigma delta: negative for x > 1, beyond every bound for x > 2.
void write_escape(ReportWriter& report) {
    constexpr std::size_t steps = 64;
    const QuadratureRule euler{.name = "Euler", .what = "", .cut = nullptr, .compositing = Compositing::euler};
    const QuadratureRule exponential{.name = "exponential", .what = "", .cut = nullptr};
    std::vector<std::vector<ReportCell>> rows;
    for (const double x : {0.1, 0.5, 0.9, 1.1, 1.9, 2.1, 3.0, 1e3, 1e8}) {
        CutRays cut{{std::vector<RayInterval>(steps, {x, 1.0, 1.0})}, steps};
        CutRays one{{{{x, 1.0, 1.0}}}, 1};
        rows.push_back({x, composited(one, euler, false).transmittance.front(),
                        composited(cut, euler, false).transmittance.front(),
                        composited(cut, exponential, false).transmittance.front(), std::exp(-x * steps)});
    }
    report.heading("Where explicit Euler fails");
    report.text(
        "A slab of 64 steps, each with the optical depth x = sigma delta. Euler's transmittance is (1 - x)^n: below 0 for x > 1 "
        "and beyond every bound for x > 2, however smooth the ray is. The exponential form is in [0, 1] for every x.");
    report.table("quadrature_euler", {"x", "Euler, 1 step", "Euler, 64 steps", "exponential, 64 steps", "exp(-64 x)"}, rows);
}

void write_choice(ReportWriter& report) {
    report.heading("The rule that the renderer uses");
    report.text(
        "The left rectangle over N intervals, in training, in fitting and for pictures: its curve is made by `sample_rays`, "
        "`composite_weights` and `composite` themselves. In exponential form it is stable for every density. Its depths at "
        "sample i "
        "lag by half an interval, which is the midpoint rule with intervals around the samples, but for the half interval at "
        "each end; so it is of second order wherever nothing is at the planes, as the blob shows.");
}

void write_quadrature(ReportWriter& report, const ReportInputs& inputs) {
    const QuadratureStudy study = measured(inputs);
    write_rules(report, study);
    write_curves(report, study);
    write_orders(report, study);
    write_escape(report);
    write_choice(report);
}

}  // namespace

QuadratureError quadrature_error(const RayResults& results, std::span<const RayProfile> rays) {
    const auto root_mean_square = [&](const std::vector<double>& values, double RayIntegral::*exact) {
        double sum = 0.0;
        for (std::size_t i = 0; i < rays.size(); ++i) sum += std::pow(values[i] - rays[i].exact.*exact, 2);
        return std::sqrt(sum / static_cast<double>(rays.size()));
    };
    return {root_mean_square(results.colour, &RayIntegral::colour),
            root_mean_square(results.transmittance, &RayIntegral::transmittance),
            results.colour_by_log_density.empty()
                ? 0.0
                : root_mean_square(results.colour_by_log_density, &RayIntegral::colour_by_log_density)};
}

std::optional<double> observed_order(std::span<const std::int64_t> counts, std::span<const double> errors, double floor) {
    constexpr std::int64_t first = 64;
    double n = 0.0, x_sum = 0.0, y_sum = 0.0, xx_sum = 0.0, xy_sum = 0.0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        if (counts[i] < first || !(errors[i] > floor) || !(errors[i] <= 1.0)) continue;
        const double x = std::log(static_cast<double>(counts[i])), y = std::log(errors[i]);
        n += 1.0;
        x_sum += x;
        y_sum += y;
        xx_sum += x * x;
        xy_sum += x * y;
    }
    constexpr double least = 3.0;
    if (n < least) return std::nullopt;
    return -(n * xy_sum - x_sum * y_sum) / (n * xx_sum - x_sum * x_sum);
}

ReportSection quadrature_section() {
    constexpr double seconds = 60.0;
    return {.name = "quadrature", .title = "Quadrature along a ray", .seconds = seconds, .write = write_quadrature};
}

}  // namespace stymo
