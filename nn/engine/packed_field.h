#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "nn/engine/aligned_vector.h"
#include "nn/engine/packed_layer.h"
#include "nn/engine/sine_network.h"

namespace stymo {

/// Points that go through a field together: as many as leave their activations and a layer's
/// weights in the second-level cache, and a multiple of the rows of a block of the packed product.
inline constexpr std::int64_t tile_points = 192;

/// Buffers of one tile of points, for one thread at a time. They grow to the largest tile and stay.
template <class T>
struct FieldTile {
    AlignedVector<T> joined;  ///< (points, encoding | hidden): the skip layer reads both as one row
    AlignedVector<T> hidden;  ///< (points, width)
    std::vector<Real<T>> phases;    ///< of the encoding of a few points, their sines and cosines
    std::vector<Real<T>> logits;    ///< (points): the density is softplus(logit)
    std::vector<Real<T>> features;  ///< (rows asked for, width)
};

/// Where the arguments of a tile's sines go, for a backward pass: (points, width) for each layer,
/// `layer_stride` elements apart. Without data they are not stored. Not of types of 16 bits.
template <class T>
struct SineArgumentRows {
    Real<T>* data = nullptr;
    std::int64_t layer_stride = 0;

    [[nodiscard]] Real<T>* layer(std::size_t index) const {
        return data + static_cast<std::int64_t>(index) * layer_stride;
    }
};

/// A folded field in the order in which products read it. T = float, double, BFloat16 or Float16 is
/// the type of weights and of activations between layers; sums, logits and features are of Real<T>.
/// Points go through all layers in tiles. What is computed of a point does not depend on the other
/// points of its tile, nor on whether arguments are stored.
template <class T>
class PackedField {
public:
    PackedField() = default;
    explicit PackedField(const FoldedField& field);

    [[nodiscard]] std::int64_t width() const { return width_; }
    [[nodiscard]] std::int64_t feature_channels() const { return finish_.outputs(); }
    /// Channels of the encoding, with zeros up to a whole number of vectors.
    [[nodiscard]] std::int64_t encoding() const { return encoding_; }
    /// Elements from one row of FieldTile::joined to the next.
    [[nodiscard]] std::int64_t joined_stride() const { return encoding_ + width_; }
    /// The number of the input of a layer as stored for each input as packed, -1 for zeros: the
    /// encoding is packed as (x, all sines, all cosines, zeros).
    [[nodiscard]] std::vector<std::int64_t> input_order(std::size_t layer) const;

    /// Makes room for so many points, so that nothing is allocated later.
    void reserve(std::int64_t points, FieldTile<T>& tile) const;
    /// The encoding of points (3 coordinates each) into tile.joined.
    void encode(std::span<const Real<T>> points, FieldTile<T>& tile) const;
    /// Logits of points (3 coordinates each) into tile.logits. The activations that they come from
    /// stay in the tile.
    void evaluate(std::span<const Real<T>> points, FieldTile<T>& tile,
                  const SineArgumentRows<T>& arguments = {}) const;
    /// The same logits from the arguments of the last layer before the features.
    void evaluate(const Real<T>* arguments, std::int64_t points, FieldTile<T>& tile) const;
    /// Features before the last layer into tile.features, of the first points of the last call of
    /// `evaluate`.
    void features(std::int64_t points, FieldTile<T>& tile,
                  const SineArgumentRows<T>& arguments = {}) const;
    /// The same of these points; ascending.
    void features(std::span<const std::int32_t> points, FieldTile<T>& tile) const;
    /// The arguments of the sines that are the features.
    void feature_arguments(std::int64_t points, const FieldTile<T>& tile, Real<T>* result) const;
    /// The last layer: composited features (rays, width) and opacities (rays) -> (rays,
    /// feature_channels).
    void finish(std::span<const Real<T>> composited, std::span<const Real<T>> opacities,
                std::span<Real<T>> result) const;

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
    [[nodiscard]] std::int64_t joined_offset(std::size_t layer) const;
    [[nodiscard]] Rows<T> output(std::size_t layer, FieldTile<T>& tile) const;
    [[nodiscard]] Rows<const T> last_output(const FieldTile<T>& tile) const;
    void take_logits(std::int64_t points, FieldTile<T>& tile) const;

    std::int64_t width_ = 0;
    std::int64_t frequencies_ = 0;
    std::int64_t encoding_ = 0;
    std::size_t skip_layer_ = 0;
    std::vector<PackedLayer<T>> layers_;
    std::vector<Real<T>> density_weight_;
    Real<T> density_bias_ = 0;
    PackedLayer<T> feature_;
    PackedLayer<Real<T>> finish_;
};

extern template class PackedField<float>;
extern template class PackedField<double>;
extern template class PackedField<kernels::BFloat16>;
extern template class PackedField<kernels::Float16>;

}  // namespace stymo
