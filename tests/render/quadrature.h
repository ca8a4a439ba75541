#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/rng.h"
#include "core/tensor.h"

/// Rules of integration along a ray, and rays whose integrals are known in closed form.
namespace stymo {

/// Equation (2) of the paper for a ray: int T sigma c ds, with T = exp(-optical depth up to s).
struct RayIntegral {
    double colour = 0.0;
    double transmittance = 0.0;
};

/// A ray of length 1, s in [0, 1].
struct RayProfile {
    std::function<double(double)> density;        ///< per length of the ray, >= 0
    std::function<double(double)> optical_depth;  ///< from 0 to s
    std::function<double(double)> colour;         ///< in [0, 1]
    std::vector<double> jumps;  ///< where the density jumps, ascending, within (0, 1)
    RayIntegral exact;
};

/// Rays of one kind. `shift` in [0, 1) moves the structure, so that no rule meets it by luck.
struct ProfileFamily {
    std::string name;
    std::string what;
    RayProfile (*ray)(double shift);
};
/// Fog, blob, step, wall, two surfaces.
[[nodiscard]] std::vector<ProfileFamily> profile_families();
/// `count` rays of a family, with shifts spread evenly.
[[nodiscard]] std::vector<RayProfile> spread_rays(const ProfileFamily& family, std::size_t count);

/// The same number of homogeneous intervals on each ray, one ray after the other.
struct Intervals {
    std::size_t rays = 0;
    std::vector<double> density;
    std::vector<double> length;
    std::vector<double> colour;
};

/// Where a rule evaluates density and colour.
enum class SamplePositions {
    renderer,  ///< render/rays.h: the left ends of N intervals
    jittered,  ///< render/rays.h as in training
    middle     ///< the middles of N intervals
};

/// A way to integrate along a ray.
struct QuadratureRule {
    std::string name;
    std::string what;
    SamplePositions positions = SamplePositions::renderer;
    bool euler = false;  ///< T - T sigma delta instead of T exp(-sigma delta)
    DType dtype = DType::float64;
};
/// The renderer's first.
[[nodiscard]] std::vector<QuadratureRule> quadrature_rules();

/// `samples`, at least 2, intervals of each ray.
[[nodiscard]] Intervals cut(const QuadratureRule& rule, std::span<const RayProfile> rays,
                            std::int64_t samples, const Rng& rng);
/// One integral for each ray, by render/composite.h but for Euler.
[[nodiscard]] std::vector<RayIntegral> integrate(const QuadratureRule& rule,
                                                 const Intervals& intervals);
/// Root mean square of `integrals` against the exact ones.
[[nodiscard]] RayIntegral quadrature_error(std::span<const RayIntegral> integrals,
                                           std::span<const RayProfile> rays);

/// Minus the slope of log error over log count, by least squares over the counts from 64 on. Errors
/// at or below `floor` are round-off, those above 1 no approximation: neither counts. Empty where
/// fewer than three are left.
[[nodiscard]] std::optional<double> observed_order(std::span<const std::int64_t> counts,
                                                   std::span<const double> errors, double floor);

}  // namespace stymo
