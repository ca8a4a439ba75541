#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "nn/engine/packed_layer.h"
#include "nn/engine/sine_network.h"

namespace stymo {

/// Number of points that are evaluated together. Their activations and one layer's weights fit into
/// the second-level cache. It is a multiple of the rows of a block of the packed product.
inline constexpr std::int64_t tile_points = 192;

/// Buffers for one tile of points, used by one thread at a time. They grow to the largest tile and
/// never shrink.
template <class T>
struct FieldTile {
    AlignedVector<T> joined;  ///< (points, encoding | hidden): the skip layer reads both as one row
    AlignedVector<T> hidden;  ///< (points, width)
    std::vector<T> phases;    ///< scratch memory of PackedField::encode
    std::vector<T> logits;    ///< (points): the density is density_of_logit(logit)
    std::vector<T> features;  ///< (rows asked for, width)
};

/// Destination for the arguments of a tile's sines, which a backward pass needs: (points, width)
/// for each layer, layers `layer_stride` elements apart. If `data` is null, nothing is stored.
template <class T>
struct SineArgumentRows {
    T* data = nullptr;
    std::int64_t layer_stride = 0;

    [[nodiscard]] T* layer(std::size_t index) const {
        return data + static_cast<std::int64_t>(index) * layer_stride;
    }
};

/// A folded field in the memory layout of the matrix products. Points are evaluated in tiles. The
/// result at a point depends neither on the other points of its tile nor on whether arguments are
/// stored. With MatmulPrecision::medium the first layer, which reads positions, has `high`. T:
/// float, double.
template <class T>
class PackedField {
public:
    PackedField() = default;
    explicit PackedField(const FoldedField& field, MatmulPrecision precision = matmul_precision());

    [[nodiscard]] std::int64_t width() const { return width_; }
    [[nodiscard]] std::int64_t feature_channels() const { return last_layer_.outputs(); }
    /// Channels of the encoding, padded with zeros to a multiple of a cache line.
    [[nodiscard]] std::int64_t encoding() const { return encoding_; }
    /// Elements from one row of FieldTile::joined to the next.
    [[nodiscard]] std::int64_t joined_stride() const { return encoding_ + width_; }
    /// Maps each packed input of a layer to the number of the stored input; -1 marks padding. The
    /// encoding is packed as (x, all sines, all cosines, padding).
    [[nodiscard]] std::vector<std::int64_t> input_order(std::size_t layer) const;

    /// Allocates the tile's buffers for this number of points, so that nothing is allocated later.
    void reserve(std::int64_t points, FieldTile<T>& tile) const;
    /// Writes the encoding of points (3 coordinates each) to tile.joined.
    void encode(std::span<const T> points, FieldTile<T>& tile) const;
    /// Writes the logits of points (3 coordinates each) to tile.logits. The last layer's
    /// activations stay in the tile, for `features`.
    void evaluate(std::span<const T> points, FieldTile<T>& tile,
                  const SineArgumentRows<T>& arguments = {}) const;
    /// Computes the same logits from the stored sine arguments of the last layer before the
    /// features.
    void evaluate(const T* arguments, std::int64_t points, FieldTile<T>& tile) const;
    /// Writes the input of the last layer (`apply_last_layer`) to tile.features, for the first
    /// `points` points of the last call of `evaluate`.
    void features(std::int64_t points, FieldTile<T>& tile,
                  const SineArgumentRows<T>& arguments = {}) const;
    /// The same for these points, in ascending order. Overwrites the activations in the tile.
    void features(std::span<const std::int32_t> points, FieldTile<T>& tile) const;
    /// Writes the sine arguments of the features, (points, width), to `result`.
    void feature_arguments(std::int64_t points, const FieldTile<T>& tile, T* result) const;
    /// Applies the last layer: composited features (rays, width) and opacities (rays) -> (rays,
    /// feature_channels).
    void apply_last_layer(std::span<const T> composited, std::span<const T> opacities,
                          std::span<T> result) const;

private:
    /// Rows of a tile's activations.
    template <class Element>
    struct Rows {
        Element* data;
        std::int64_t stride;
    };
    [[nodiscard]] bool reads_encoding(std::size_t layer) const {
        return layer == 0 || layer == skip_layer_;
    }
    [[nodiscard]] FoldedLayer reordered(const FoldedLayer& layer, std::size_t index) const;
    [[nodiscard]] Rows<T> output(std::size_t layer, FieldTile<T>& tile) const;
    [[nodiscard]] Rows<const T> last_output(const FieldTile<T>& tile) const;
    void take_logits(std::int64_t points, FieldTile<T>& tile) const;

    std::int64_t width_ = 0;
    std::int64_t frequencies_ = 0;
    std::int64_t encoding_ = 0;
    std::size_t skip_layer_ = 0;
    std::vector<PackedLayer<T>> layers_;
    std::vector<T> density_weight_;
    T density_bias_ = 0;
    PackedLayer<T> feature_;
    PackedLayer<T> last_layer_;
};

extern template class PackedField<float>;
extern template class PackedField<double>;

/// Evaluates a field at `count` points, tile by tile on several threads. position_of(i) returns a
/// range of 3 coordinates. Calls store(first, size, tile) for each tile, on any thread. The tile
/// holds the logits of points [first, first + size). `store` may compute the features of these
/// points with PackedField::features.
template <class T, class PositionOf, class Store>
void evaluate_points(const PackedField<T>& field, std::int64_t count, const PositionOf& position_of,
                     const Store& store) {
    constexpr std::int64_t points_per_chunk = 4 * tile_points;
    parallel_for(count, points_per_chunk, [&](std::int64_t chunk_begin, std::int64_t chunk_end) {
        FieldTile<T> tile;
        std::vector<T> points;
        for (std::int64_t begin = chunk_begin; begin < chunk_end; begin += tile_points) {
            const std::int64_t end = std::min(begin + tile_points, chunk_end);
            points.clear();
            for (std::int64_t i = begin; i < end; ++i) {
                for (const auto coordinate : position_of(i))
                    points.push_back(static_cast<T>(coordinate));
            }
            field.evaluate(points, tile);
            store(begin, end - begin, tile);
        }
    });
}

}  // namespace stymo
