#include "render/quadrature.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/ops/ops.h"
#include "render/composite.h"
#include "render/rays.h"

namespace stymo {

namespace {

constexpr double colour_begin = 0.25, colour_rise = 0.5;

/// From one jump to the next.
struct Piece {
    double end;
    double density;
};

/// (1 - exp(-x)) / x: the mean of exp(-u) over [0, x].
double mean_exponential(double x) {
    return x > 0.0 ? -std::expm1(-x) / x : 1.0;
}

double depth_of(const std::vector<Piece>& pieces, double s) {
    double depth = 0.0, begin = 0.0;
    for (const Piece& piece : pieces) {
        if (s <= begin) break;
        depth += piece.density * (std::min(s, piece.end) - begin);
        begin = piece.end;
    }
    return depth;
}

/// Integrated by parts: int T sigma c = c(0) - c(1) T(1) + c' int T.
RayIntegral piecewise_integral(const std::vector<Piece>& pieces) {
    double begin = 0.0, depth = 0.0, sum = 0.0;
    for (const Piece& piece : pieces) {
        const double length = piece.end - begin, x = piece.density * length;
        sum += std::exp(-depth) * length * mean_exponential(x);
        depth += x;
        begin = piece.end;
    }
    const double behind = std::exp(-depth);
    return {.colour = colour_begin - (colour_begin + colour_rise) * behind + colour_rise * sum,
            .transmittance = behind};
}

/// Constant density between jumps; the colour is linear in s.
RayProfile piecewise(const std::vector<Piece>& pieces) {
    RayProfile ray;
    ray.density = [pieces](double s) {
        for (const Piece& piece : pieces)
            if (s < piece.end) return piece.density;
        return pieces.back().density;
    };
    ray.optical_depth = [pieces](double s) { return depth_of(pieces, s); };
    ray.colour = [](double s) { return colour_begin + colour_rise * s; };
    for (std::size_t i = 0; i + 1 < pieces.size(); ++i) ray.jumps.push_back(pieces[i].end);
    ray.exact = piecewise_integral(pieces);
    return ray;
}

/// A density whose optical depth tau is known. The colour is linear in tau, which leaves integrals
/// of exp(-tau) times powers of tau.
RayProfile smooth(std::function<double(double)> density,
                  std::function<double(double)> optical_depth) {
    const double depth = optical_depth(1.0), behind = std::exp(-depth), rise = colour_rise / depth;
    RayProfile ray;
    ray.exact = {.colour = -colour_begin * std::expm1(-depth) +
                           rise * (-std::expm1(-depth) - depth * behind),
                 .transmittance = behind};
    ray.density = std::move(density);
    ray.colour = [optical_depth, rise](double s) { return colour_begin + rise * optical_depth(s); };
    ray.optical_depth = std::move(optical_depth);
    return ray;
}

RayProfile fog(double shift) {
    const double density = 8.0, decay = 4.0 + shift;
    return smooth([=](double s) { return density * std::exp(-decay * s); },
                  [=](double s) { return -density / decay * std::expm1(-decay * s); });
}

RayProfile blob(double shift) {
    const double density = 30.0, middle = 0.45 + 0.1 * shift, width = 0.06;
    const double scale = width * std::numbers::sqrt2;
    const auto cumulative = [=](double s) { return std::erf((s - middle) / scale); };
    return smooth([=](double s) { return density * std::exp(-std::pow((s - middle) / scale, 2)); },
                  [=](double s) {
                      return density * scale * std::sqrt(std::numbers::pi) / 2.0 *
                             (cumulative(s) - cumulative(0.0));
                  });
}

RayProfile step(double shift) {
    return piecewise({{0.4 + 0.1 * shift, 0.0}, {1.0, 10.0}});
}

RayProfile wall(double shift) {
    return piecewise({{0.4 + 0.1 * shift, 0.0}, {1.0, 1e8}});
}

RayProfile two_surfaces(double shift) {
    const double width = 0.02, first = 0.3 + 0.1 * shift, second = 0.7 + 0.1 * shift;
    return piecewise({{first, 0.0}, {first + width, 1.0 / width}, {second, 0.0}, {1.0, 1e3}});
}

}  // namespace

std::vector<ProfileFamily> profile_families() {
    return {{"fog", "8 exp(-4 s) to 8 exp(-5 s)", fog},
            {"blob", "a Gaussian of width 0.06, optical depth 4.5", blob},
            {"step", "0, then 10", step},
            {"wall", "0, then 1e8", wall},
            {"two surfaces", "0.02 wide with optical depth 1, then 1000", two_surfaces}};
}

std::vector<RayProfile> spread_rays(const ProfileFamily& family, std::size_t count) {
    std::vector<RayProfile> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const double shift = std::numbers::phi * static_cast<double>(i);
        rays.push_back(family.ray(shift - std::floor(shift)));
    }
    return rays;
}

namespace {

void append(Intervals& intervals, const RayProfile& ray, double position, double length) {
    intervals.density.push_back(ray.density(position));
    intervals.length.push_back(length);
    intervals.colour.push_back(ray.colour(position));
}

/// The renderer's own sampling of a frontal camera's rays, each scaled to the length 1.
Intervals renderer_cut(std::span<const RayProfile> rays, std::int64_t samples, Rng* jitter) {
    RaySampling sampling;
    sampling.samples_per_ray = samples;
    sampling.rays_per_side = std::llround(std::ceil(std::sqrt(static_cast<double>(rays.size()))));
    const Camera camera = camera_from_pose({}, {});
    const RaySamples drawn = sample_rays({camera}, sampling, jitter, DType::float64);
    const auto depths = drawn.depths.values<double>(), deltas = drawn.deltas.values<double>();
    const auto count = static_cast<std::size_t>(samples);
    Intervals intervals;
    intervals.rays = rays.size();
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const auto pixel = static_cast<std::int64_t>(i);
        const Ray line = camera_ray(camera, sampling, pixel / sampling.rays_per_side,
                                    pixel % sampling.rays_per_side);
        const double length = line.far_distance - line.near_distance;
        for (std::size_t k = i * count; k < (i + 1) * count; ++k)
            append(intervals, rays[i], (depths[k] - line.near_distance) / length,
                   deltas[k] / length);
    }
    return intervals;
}

/// Explicit Euler on dT/ds = -sigma T.
std::vector<RayIntegral> euler(const Intervals& intervals) {
    std::vector<RayIntegral> integrals;
    const std::size_t count = intervals.density.size() / intervals.rays;
    for (std::size_t ray = 0; ray < intervals.rays; ++ray) {
        RayIntegral sum{.transmittance = 1.0};
        for (std::size_t k = ray * count; k < (ray + 1) * count; ++k) {
            const double x = intervals.density[k] * intervals.length[k];
            sum.colour += sum.transmittance * x * intervals.colour[k];
            sum.transmittance *= 1.0 - x;
        }
        integrals.push_back(sum);
    }
    return integrals;
}

}  // namespace

std::vector<QuadratureRule> quadrature_rules() {
    return {{.name = "left rectangle", .what = "the renderer's: equations (3) to (5), N intervals"},
            {.name = "left rectangle, float32",
             .what = "the same, composited in the renderer's number format",
             .dtype = DType::float32},
            {.name = "jittered",
             .what = "the renderer's in training: every bound moves within its stratum",
             .positions = SamplePositions::jittered},
            {.name = "midpoint",
             .what = "density and colour in the middle of N intervals",
             .positions = SamplePositions::middle},
            {.name = "Euler", .what = "explicit Euler on dT/ds = -sigma T", .euler = true}};
}

Intervals cut(const QuadratureRule& rule, std::span<const RayProfile> rays, std::int64_t samples,
              const Rng& rng) {
    Rng jitter = rng;
    if (rule.positions != SamplePositions::middle)
        return renderer_cut(rays, samples,
                            rule.positions == SamplePositions::jittered ? &jitter : nullptr);
    Intervals intervals;
    intervals.rays = rays.size();
    const double length = 1.0 / static_cast<double>(samples);
    for (const RayProfile& ray : rays)
        for (std::int64_t i = 0; i < samples; ++i)
            append(intervals, ray, (static_cast<double>(i) + 0.5) * length, length);
    return intervals;
}

std::vector<RayIntegral> integrate(const QuadratureRule& rule, const Intervals& intervals) {
    if (rule.euler) return euler(intervals);
    const auto rays = static_cast<std::int64_t>(intervals.rays);
    const auto tensor = [&](const std::vector<double>& values) {
        return Tensor::from({1, rays, std::ssize(values) / rays}, values).to(rule.dtype);
    };
    const CompositeWeights weights =
        composite_weights(tensor(intervals.density), tensor(intervals.length));
    const Tensor colours = tensor(intervals.colour).reshaped({1, std::ssize(intervals.colour), 1});
    const std::vector<double> values = composite(weights.weights, colours).value().to_vector(),
                              behind = weights.transmittance.value().to_vector();
    std::vector<RayIntegral> integrals;
    for (std::size_t i = 0; i < values.size(); ++i) integrals.push_back({values[i], behind[i]});
    return integrals;
}

RayIntegral quadrature_error(std::span<const RayIntegral> integrals,
                             std::span<const RayProfile> rays) {
    const auto root_mean_square = [&](double RayIntegral::*quantity) {
        double sum = 0.0;
        for (std::size_t i = 0; i < rays.size(); ++i)
            sum += std::pow(integrals[i].*quantity - rays[i].exact.*quantity, 2);
        return std::sqrt(sum / static_cast<double>(rays.size()));
    };
    return {root_mean_square(&RayIntegral::colour), root_mean_square(&RayIntegral::transmittance)};
}

std::optional<double> observed_order(std::span<const std::int64_t> counts,
                                     std::span<const double> errors, double floor) {
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

}  // namespace stymo
