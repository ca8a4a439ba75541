#pragma once

#include <cstdint>
#include <vector>

#include "nn/engine/packed_layer.h"
#include "nn/models/radiance_field.h"
#include "nn/models/realtime/vertex_grid.h"
#include "nn/models/realtime/view_range.h"
#include "render/rays.h"

namespace stymo {

struct BakeOptions {
    std::int64_t resolution =
        96;  ///< cells along the longest side of the box; rounded up to a multiple of 4
    std::int64_t dimension =
        64;  ///< numbers kept of a point's features; rounded up to a multiple of 16
    double tolerance = 1e-2;  ///< compositing weight up to which a sample may have the mean feature
                              ///< instead of its own
};

/// One face's field at the vertices of a box of cubic cells which holds what the views see. The
/// field was evaluated at vertices of the cells that may show from outside of the box, found from
/// coarse to fine; the other vertices have a density interpolated from coarser ones, and the mean
/// feature.
struct BakedSamples {
    VertexGrid grid;
    std::vector<float> logits;            ///< of each vertex: the density is softplus(logit)
    std::vector<std::int32_t> record_of;  ///< of each vertex: which record has its features
    std::int64_t dimension = 0;           ///< numbers of a record, a multiple of 16
    std::vector<kernels::BFloat16>
        records;  ///< coefficients of the features; record 0 is the mean, all zeros
    /// (dimension + 1, feature_channels): directions that the coefficients belong to, and last the
    /// mean, to which the opacity belongs. Features are those after the field's last layer.
    Tensor finish;
    std::int64_t evaluated_points = 0;  ///< evaluations of the field, with or without features

    [[nodiscard]] std::int64_t bytes() const;
};

inline constexpr std::int64_t most_baked_bytes = 300'000'000;
/// What a field baked with these options takes if every cell shows.
[[nodiscard]] std::int64_t baked_bytes(const BakeOptions& options);

/// `rays` tells where the views have their samples, and how long a piece of a ray they stand for.
/// Throws ValueError for a resolution below 8, a dimension below 1, options of more than
/// `most_baked_bytes`, and as `sample_rays` for the outermost views.
[[nodiscard]] BakedSamples bake(const FoldedField& field, const RaySampling& rays,
                                const ViewRange& views, const BakeOptions& options);

}  // namespace stymo
