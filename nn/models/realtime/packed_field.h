#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/kernels/gemm.h"
#include "nn/models/radiance_field.h"
#include "nn/models/realtime/packed_layer.h"

namespace stymo {

/// Buffers of one tile of points, for one thread at a time. They grow to the largest tile and stay.
template <class T>
struct FieldTile {
    std::vector<T> joined;        ///< (points, encoding | hidden): the skip layer reads both as one row
    std::vector<T> hidden;        ///< (points, width)
    std::vector<float> density;   ///< (points)
    std::vector<float> features;  ///< (rows asked for, width)
};

/// A folded field in the order in which products read it, T = float, BFloat16 or Float16 (weights, and activations between
/// layers; sums, density and features are float32). Points go through all layers in tiles, so that what lies between two layers
/// does not leave the second-level cache.
template <class T>
class PackedField {
public:
    PackedField() = default;
    explicit PackedField(const FoldedField& field);

    [[nodiscard]] std::int64_t width() const { return width_; }
    [[nodiscard]] std::int64_t feature_channels() const { return finish_.outputs(); }

    /// Makes room for so many points, so that nothing is allocated later.
    void reserve(std::int64_t points, FieldTile<T>& tile) const;
    /// Densities of points (3 numbers each) into tile.density. The activations that they come from stay in the tile.
    void density(std::span<const float> points, FieldTile<T>& tile) const;
    /// Features before the last layer into tile.features, of these of the points of the last call of `density`; ascending.
    void features(std::span<const std::int32_t> rows, FieldTile<T>& tile) const;
    /// The last layer: composited features (rays, width) and opacities (rays) -> (rays, feature_channels).
    void finish(std::span<const float> composited, std::span<const float> opacities, std::span<float> result) const;

private:
    /// Rows of a tile's activations.
    template <class Element>
    struct Rows {
        Element* data;
        std::int64_t stride;
    };
    [[nodiscard]] FoldedLayer with_encoding_reordered(const FoldedLayer& layer) const;
    void encode(std::span<const float> points, FieldTile<T>& tile) const;
    [[nodiscard]] Rows<T> output(std::size_t layer, FieldTile<T>& tile) const;

    std::int64_t width_ = 0;
    std::int64_t frequencies_ = 0;
    std::int64_t encoding_ = 0;  ///< channels, with zeros up to a whole number of vectors
    std::size_t skip_layer_ = 0;
    std::vector<PackedLayer<T>> layers_;
    std::vector<float> density_weight_;
    float density_bias_ = 0.0F;
    PackedLayer<T> feature_;
    PackedLayer<float> finish_;
};

extern template class PackedField<float>;
extern template class PackedField<kernels::BFloat16>;
extern template class PackedField<kernels::Float16>;

}  // namespace stymo
