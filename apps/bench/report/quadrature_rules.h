#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "apps/bench/report/ray_profile.h"
#include "core/dtype.h"
#include "core/rng.h"

namespace stymo {

/// A part of a ray that is taken for homogeneous.
struct RayInterval {
    double density = 0.0;
    double length = 0.0;
    double colour = 0.0;
};

/// How a rule has cut rays.
struct CutRays {
    std::vector<std::vector<RayInterval>> rays;  ///< in order along each ray
    std::int64_t evaluations = 0;                ///< of density and colour, on all rays
};

/// What becomes of the intervals.
enum class Compositing {
    exponential,  ///< render/composite.h, with its gradient
    euler,        ///< T - T sigma delta: explicit Euler on dT/ds = -sigma T
};

/// A way to integrate along a ray.
struct QuadratureRule {
    std::string name;
    std::string what;
    /// With about so many evaluations on each ray, at least 2.
    CutRays (*cut)(std::span<const RayProfile> rays, std::int64_t evaluations, const Rng& rng);
    Compositing compositing = Compositing::exponential;
    DType dtype = DType::float64;
};

/// The renderer's first.
[[nodiscard]] std::vector<QuadratureRule> quadrature_rules();

/// One number for each ray.
struct RayResults {
    std::vector<double> colour;
    std::vector<double> transmittance;
    std::vector<double> colour_by_log_density;  ///< empty unless asked for
};

[[nodiscard]] RayResults composited(const CutRays& cut, const QuadratureRule& rule, bool with_gradient);

}  // namespace stymo
