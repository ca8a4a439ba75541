#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "nn/models/radiance_field.h"
#include "nn/models/realtime/density_lattice.h"
#include "render/rays.h"

namespace stymo {

struct BakeOptions {
    std::int64_t resolution = 96;  ///< cells along the longest side of the baked box; rounded up to a multiple of 4
    std::int64_t dimension = 32;   ///< numbers kept of a point's features; rounded up to a multiple of 16
    double tolerance = 1e-2;       ///< compositing weight up to which a sample may have the mean feature instead of its own
};

/// What rays see of a field.
struct RayFeatures {
    Tensor features;  ///< (R, feature_channels), after the field's last layer
    Tensor opacity;   ///< (R)
    Tensor depth;     ///< (R), expected distance; what is left of the light travels to the ray's last sample
};

/// One face's field, sampled once at the vertices of a box of cubic cells and read by trilinear interpolation. Evaluated are the
/// vertices whose cells may show from outside, found from coarse to fine; elsewhere stand the density of the coarser vertices and
/// the mean feature. Outside of the box, which holds all that may show, there is nothing. The density is interpolated before
/// its softplus, the features are reduced to the plane that keeps most of their variance. Holds at most baked_bytes(options).
class BakedField {
public:
    /// `rays` tells where samples can lie. Throws ValueError for a resolution below 8 and for options of more than
    /// `most_baked_bytes`.
    BakedField(const FoldedField& field, const RaySampling& rays, const BakeOptions& options);

    /// The samples of one camera.
    [[nodiscard]] RayFeatures operator()(const RaySamples& samples) const;

    /// Vertices at which the field was evaluated with its features.
    [[nodiscard]] std::int64_t feature_vertices() const { return static_cast<std::int64_t>(records_.size()) / dimension_ - 1; }
    /// Evaluations of the field in all.
    [[nodiscard]] std::int64_t evaluated_points() const { return evaluated_points_; }
    [[nodiscard]] const Lattice& lattice() const { return lattice_; }
    [[nodiscard]] std::int64_t bytes() const;

private:
    void mark_occupied_blocks(double least_density);
    void gather(const std::array<float, 3>& place, float weight, float* coefficients) const;
    void march(const float* points, const float* deltas, const float* depths, std::int64_t count, float* coefficients,
               float* depth) const;

    Lattice lattice_;
    std::int64_t dimension_ = 0;
    std::int64_t evaluated_points_ = 0;
    std::vector<float> density_input_;        ///< before the softplus, of each vertex
    std::vector<std::int32_t> record_of_;     ///< of each vertex; 0: the mean
    std::vector<std::uint16_t> records_;      ///< upper halves of float32, `dimension` for each record
    std::vector<std::uint8_t> block_is_empty_;  ///< blocks of 4 cells along each side
    std::array<std::int64_t, 3> blocks_{};
    Tensor finish_;  ///< (feature_channels, dimension + 1): the directions, and the mean, which the opacity multiplies
};

inline constexpr std::int64_t most_baked_bytes = 300'000'000;
/// What a field baked with these options takes if every cell shows.
[[nodiscard]] std::int64_t baked_bytes(const BakeOptions& options);

}  // namespace stymo
