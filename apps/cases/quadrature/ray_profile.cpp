#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "apps/cases/quadrature/quadrature.h"

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

}  // namespace stymo
