#pragma once

#include <cstdint>
#include <vector>

#include "nn/engine/packed_layer.h"
#include "nn/models/radiance_field.h"
#include "nn/realtime/vertex_grid.h"
#include "nn/realtime/view_range.h"
#include "render/rays.h"

namespace stymo {

struct BakeOptions {
    /// Cells along the longest side of the box; rounded up to a multiple of 4.
    std::int64_t resolution = 96;
    /// Principal components kept of a point's features; rounded up to a multiple of 16.
    std::int64_t dimension = 64;
    double tolerance = 1e-2;  ///< samples of at most this compositing weight may have the mean
                              ///< feature instead of their own
};

/// One face's field at the vertices of a box of cubic cells that contains what the views see. The
/// field is evaluated, from coarse to fine, at the vertices of the cells that may be visible from
/// outside the box. The other vertices have a density interpolated from coarser vertices, and the
/// mean feature.
struct BakedSamples {
    VertexGrid grid;
    std::vector<float> logits;            ///< for each vertex; the density is softplus(logit)
    std::vector<std::int32_t> record_of;  ///< for each vertex, the record of its features
    std::int64_t dimension = 0;           ///< numbers of a record, a multiple of 16
    /// Coefficients of the features, `dimension` for each record. Record 0 is the mean feature, all
    /// zeros.
    std::vector<kernels::BFloat16> records;
    /// (dimension + 1, feature_channels): one direction for each coefficient, and in the last row
    /// the mean, which is multiplied by the opacity. The products are the features after the
    /// field's last layer.
    Tensor finish;
    std::int64_t evaluated_points = 0;  ///< number of field evaluations, with or without features

    [[nodiscard]] std::int64_t bytes() const;
};

/// Upper limit of `baked_bytes`.
inline constexpr std::int64_t most_baked_bytes = 300'000'000;
/// Bytes of a field that is baked with these options if every cell is visible.
[[nodiscard]] std::int64_t baked_bytes(const BakeOptions& options);

/// Bakes a field for these views. `rays` gives the positions and the intervals of the samples along
/// rays. Throws ValueError for a resolution below 8, a dimension below 1 and options whose
/// `baked_bytes` exceed `most_baked_bytes`, and what `sample_rays` throws for the outermost views.
[[nodiscard]] BakedSamples bake(const FoldedField& field, const RaySampling& rays,
                                const ViewRange& views, const BakeOptions& options);

}  // namespace stymo
