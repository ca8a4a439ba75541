#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/kernels/gemm.h"
#include "nn/models/radiance_field.h"

namespace stymo {

/// Buffers of one tile of points, for one thread at a time. They grow to the largest tile and stay.
template <class T>
struct FieldTile {
    std::vector<T> encoded;        ///< (points, encoding | hidden): the skip layer reads both as one row
    std::vector<T> hidden;         ///< (points, width)
    std::vector<float> density;    ///< (points)
    std::vector<float> features;   ///< (rows asked for, width)
};

/// A folded field in the order in which products read it, T = float or BFloat16 (weights and activations between layers; sums,
/// density and features are float32). Points go through all layers in tiles, so that what lies between two layers never leaves
/// the cache.
template <class T>
class PackedField {
public:
    PackedField() = default;
    explicit PackedField(const FoldedField& field);

    [[nodiscard]] std::int64_t width() const { return width_; }
    [[nodiscard]] std::int64_t feature_channels() const { return finish_.columns(); }

    /// Densities of points (3 numbers each) into tile.density; the activations they come from stay in the tile.
    void density(std::span<const float> points, FieldTile<T>& tile) const;
    /// Features before the last layer, of the points of the last call of `density` at `rows` (ascending), into tile.features. Without rows: of all.
    void features(std::span<const std::int32_t> rows, FieldTile<T>& tile) const;
    void features(FieldTile<T>& tile) const;
    /// The last layer: composited features (rays, width) and their opacities (rays) -> (rays, feature_channels).
    void finish(std::span<const float> composited, std::span<const float> opacities, float* result) const;

private:
    struct Layer {
        kernels::PackedMatrix<T> weight;
        std::vector<float> bias;
    };
    [[nodiscard]] static Layer pack(const FoldedLayer& layer);

    std::int64_t width_ = 0;
    std::int64_t frequencies_ = 0;
    std::size_t skip_layer_ = 0;
    std::vector<Layer> layers_;
    std::vector<float> density_weight_;
    float density_bias_ = 0.0F;
    Layer feature_;
    kernels::PackedMatrix<float> finish_;
    std::vector<float> finish_bias_;
};

}  // namespace stymo
