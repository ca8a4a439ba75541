#pragma once

#include <functional>
#include <string>
#include <vector>

/// Rays whose integrals are known in closed form, to hold rules of quadrature against.
namespace stymo {

/// What equation (2) gives for a ray: int T sigma c ds, with T = exp(-optical depth up to s).
struct RayIntegral {
    double colour = 0.0;
    double transmittance = 0.0;
    double colour_by_log_density = 0.0;  ///< d colour / d k at k = 1 for the density k sigma, the colours held
};

/// A ray of length 1, s in [0, 1].
struct RayProfile {
    std::function<double(double)> density;        ///< per length of the ray, >= 0
    std::function<double(double)> optical_depth;  ///< from 0 to s
    std::function<double(double)> colour;         ///< in [0, 1]
    std::vector<double> jumps;                    ///< where the density jumps, ascending, within (0, 1)
    RayIntegral exact;
};

/// Rays of one kind.
struct ProfileFamily {
    std::string name;
    std::string what;
    bool smooth = false;              ///< without jumps
    RayProfile (*ray)(double shift);  ///< `shift` in [0, 1) moves the structure, so that no rule meets it by luck
};

/// Slab, fog, blob, ramp, oscillation, step, shell, wall, two surfaces, empty.
[[nodiscard]] std::vector<ProfileFamily> profile_families();
/// `count` rays of a family, shifts spread evenly.
[[nodiscard]] std::vector<RayProfile> spread_rays(const ProfileFamily& family, std::size_t count);

}  // namespace stymo
