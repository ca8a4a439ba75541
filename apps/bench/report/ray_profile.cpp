#include "apps/bench/report/ray_profile.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

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

/// (1 - (1 + x) exp(-x)) / x: the integral of u exp(-u) over [0, x], over x.
double mean_weighted_exponential(double x) {
    constexpr double small = 1e-3;
    // The closed form cancels; what the series leaves out is of order x^4.
    if (x < small) return x * (1.0 / 2.0 - x * (1.0 / 3.0 - x / 8.0));
    return (-std::expm1(-x) - x * std::exp(-x)) / x;
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

/// Integrated by parts: int T sigma c = c(0) - c(1) T(1) + c' int T, and its derivative c(1) tau T(1) - c' int tau T.
RayIntegral piecewise_integral(const std::vector<Piece>& pieces) {
    double begin = 0.0, depth = 0.0, sum_t = 0.0, sum_tau_t = 0.0;
    for (const Piece& piece : pieces) {
        const double length = piece.end - begin, x = piece.density * length, transmittance = std::exp(-depth);
        sum_t += transmittance * length * mean_exponential(x);
        sum_tau_t += transmittance * length * (depth * mean_exponential(x) + mean_weighted_exponential(x));
        depth += x;
        begin = piece.end;
    }
    const double behind = std::exp(-depth), colour_end = colour_begin + colour_rise;
    return {.colour = colour_begin - colour_end * behind + colour_rise * sum_t,
            .transmittance = behind,
            .colour_by_log_density = colour_end * depth * behind - colour_rise * sum_tau_t};
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

/// A density whose optical depth tau is known. The colour is linear in tau, which leaves integrals of exp(-tau) times powers of
/// tau.
RayProfile smooth(std::function<double(double)> density, std::function<double(double)> optical_depth) {
    const double depth = optical_depth(1.0), behind = std::exp(-depth), rise = colour_rise / depth;
    RayProfile ray;
    ray.exact = {
        .colour = -colour_begin * std::expm1(-depth) + rise * (-std::expm1(-depth) - depth * behind),
        .transmittance = behind,
        .colour_by_log_density = colour_begin * depth * behind + rise * (std::expm1(-depth) + depth * (depth + 1.0) * behind)};
    ray.density = std::move(density);
    ray.colour = [optical_depth, rise](double s) { return colour_begin + rise * optical_depth(s); };
    ray.optical_depth = std::move(optical_depth);
    return ray;
}

RayProfile slab(double shift) {
    return piecewise({{1.0, 3.0 + shift}});
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
    return smooth(
        [=](double s) { return density * std::exp(-std::pow((s - middle) / scale, 2)); },
        [=](double s) { return density * scale * std::sqrt(std::numbers::pi) / 2.0 * (cumulative(s) - cumulative(0.0)); });
}

RayProfile ramp(double shift) {
    const double slope = 6.0 + shift;
    return smooth([=](double s) { return slope * s; }, [=](double s) { return slope * s * s / 2.0; });
}

RayProfile oscillation(double shift) {
    const double density = 3.0, frequency = 2.0 * std::numbers::pi * 32.0, phase = 2.0 * std::numbers::pi * shift;
    return smooth([=](double s) { return density * (1.0 + std::cos(frequency * s + phase)); },
                  [=](double s) { return density * (s + (std::sin(frequency * s + phase) - std::sin(phase)) / frequency); });
}

RayProfile step(double shift) {
    return piecewise({{0.4 + 0.1 * shift, 0.0}, {1.0, 10.0}});
}

RayProfile shell(double shift) {
    const double width = 1e-3, begin = 0.4 + 0.1 * shift;
    return piecewise({{begin, 0.0}, {begin + width, 3.0 / width}, {1.0, 0.0}});
}

RayProfile wall(double shift) {
    return piecewise({{0.4 + 0.1 * shift, 0.0}, {1.0, 1e8}});
}

RayProfile two_surfaces(double shift) {
    const double width = 0.02, first = 0.3 + 0.1 * shift, second = 0.7 + 0.1 * shift;
    return piecewise({{first, 0.0}, {first + width, 1.0 / width}, {second, 0.0}, {1.0, 1e3}});
}

RayProfile empty(double) {
    return piecewise({{1.0, 0.0}});
}

}  // namespace

std::vector<ProfileFamily> profile_families() {
    return {{"slab", "homogeneous, optical depth 3 to 4", true, slab},
            {"fog", "8 exp(-4 s) to 8 exp(-5 s)", true, fog},
            {"blob", "a Gaussian of width 0.06, optical depth 4.5", true, blob},
            {"ramp", "6 s to 7 s", true, ramp},
            {"oscillation", "3 (1 + cos), 32 waves on the ray", true, oscillation},
            {"step", "0, then 10", false, step},
            {"shell", "1e-3 of the ray wide, optical depth 3", false, shell},
            {"wall", "0, then 1e8", false, wall},
            {"two surfaces", "0.02 wide with optical depth 1, then 1000", false, two_surfaces},
            {"empty", "0", true, empty}};
}

std::vector<RayProfile> spread_rays(const ProfileFamily& family, std::size_t count) {
    std::vector<RayProfile> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const double shift = std::numbers::phi * static_cast<double>(i);
        rays.push_back(family.ray(shift - std::floor(shift)));
    }
    return rays;
}

}  // namespace stymo
