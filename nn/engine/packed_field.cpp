#include "nn/engine/packed_field.h"

#include "core/kernels/sine.h"
#include "core/work_counts.h"
#include "render/encoding.h"

namespace stymo {
namespace {

/// A row begins with the channels of the encoding. Their number is rounded up to this multiple, so
/// that the rest of the row begins on a cache line.
template <class T>
constexpr std::int64_t encoding_multiple = 64 / static_cast<std::int64_t>(sizeof(T));
/// The phases of so many points fill whole vector registers; the phases of one point do not.
constexpr std::int64_t points_at_once = 8;

/// Positions that are rounded to one bfloat16 would move by up to 2^-9 of their distance from the
/// origin, half a pixel of an image of 256.
MatmulPrecision first_layer_precision(MatmulPrecision precision) {
    return precision == MatmulPrecision::medium ? MatmulPrecision::high : precision;
}

template <class T>
T dot(const T* row, const T* weight, std::int64_t count) {
    T sum = T(0);
#pragma omp simd reduction(+ : sum)
    for (std::int64_t i = 0; i < count; ++i) sum += row[i] * weight[i];
    return sum;
}

template <class T>
void take_sines(const T* arguments, T* to, std::int64_t stride, std::int64_t rows,
                std::int64_t width) {
    for (std::int64_t row = 0; row < rows; ++row)
        kernels::sine_cosine(arguments + row * width, to + row * stride, static_cast<T*>(nullptr),
                             width);
}

}  // namespace

template <class T>
std::vector<std::int64_t> PackedField<T>::input_order(std::size_t layer) const {
    std::vector<std::int64_t> order;
    if (reads_encoding(layer)) {
        for (std::int64_t i = 0; i < 3; ++i) order.push_back(i);
        for (const std::int64_t first : {3, 6}) {
            for (std::int64_t i = 0; i < 3 * frequencies_; ++i)
                order.push_back(first + i / 3 * 6 + i % 3);
        }
        order.resize(static_cast<std::size_t>(encoding_), -1);
    }
    const std::int64_t first = reads_encoding(layer) ? encoded_channels(frequencies_) : 0;
    for (std::int64_t i = 0; layer > 0 && i < width_; ++i) order.push_back(first + i);
    return order;
}

template <class T>
FoldedLayer PackedField<T>::reordered(const FoldedLayer& layer, std::size_t index) const {
    if (!reads_encoding(index)) return layer;
    const std::vector<std::int64_t> order = input_order(index);
    const std::int64_t out = layer.weight.shape(0), in = layer.weight.shape(1);
    FoldedLayer result{Tensor::zeros({out, std::ssize(order)}, layer.weight.dtype()), layer.bias,
                       layer.activation};
    const T* from = layer.weight.values<T>().data();
    T* to = result.weight.template mutable_values<T>().data();
    for (std::int64_t row = 0; row < out; ++row, from += in) {
        for (const std::int64_t input : order) *to++ = input < 0 ? T(0) : from[input];
    }
    return result;
}

template <class T>
PackedField<T>::PackedField(const FoldedField& field, MatmulPrecision precision)
    : width_(field.layers.front().weight.shape(0)),
      frequencies_(field.frequencies),
      encoding_(chunk_count(encoded_channels(field.frequencies), encoding_multiple<T>) *
                encoding_multiple<T>),
      skip_layer_(field.skip_layer),
      density_weight_(values_of<T>(field.density.weight)),
      density_bias_(field.density.bias.values<T>().front() - T(1)),
      feature_(field.feature0, precision) {
    for (std::size_t i = 0; i < field.layers.size(); ++i)
        layers_.emplace_back(reordered(field.layers[i], i),
                             i == 0 ? first_layer_precision(precision) : precision);
    if (field.feature1.weight.defined()) last_layer_ = PackedLayer<T>(field.feature1, precision);
}

template <class T>
void PackedField<T>::encode(std::span<const T> points, FieldTile<T>& tile) const {
    const std::int64_t count = static_cast<std::int64_t>(points.size()) / 3;
    const std::int64_t phase_count = 3 * frequencies_;
    T* const phases = tile.phases.data();
    T* const sines = phases + points_at_once * phase_count;
    T* const cosines = sines + points_at_once * phase_count;
    T* const row = cosines + points_at_once * phase_count;
    std::fill_n(row, encoding_, T(0));
    for (std::int64_t first = 0; first < count; first += points_at_once) {
        const std::int64_t last = std::min(count, first + points_at_once);
        T* phase = phases;
        for (std::int64_t point = first; point < last; ++point) {
            const T* x = points.data() + 3 * point;
            T frequency(1);
            for (std::int64_t octave = 0; octave < frequencies_; ++octave, frequency *= 2) {
                for (std::int64_t axis = 0; axis < 3; ++axis) *phase++ = x[axis] * frequency;
            }
        }
        kernels::sine_cosine(phases, sines, cosines, phase - phases);
        for (std::int64_t point = first; point < last; ++point) {
            std::copy_n(points.data() + 3 * point, 3, row);
            std::copy_n(sines + (point - first) * phase_count, phase_count, row + 3);
            std::copy_n(cosines + (point - first) * phase_count, phase_count,
                        row + 3 + phase_count);
            std::copy_n(row, encoding_, tile.joined.data() + point * joined_stride());
        }
    }
}

/// Layers write to the two buffers in turn, so that the layer before the skip layer writes next to
/// the encoding.
template <class T>
typename PackedField<T>::template Rows<T> PackedField<T>::output(std::size_t layer,
                                                                 FieldTile<T>& tile) const {
    if ((layer + skip_layer_) % 2 == 1) return {tile.joined.data() + encoding_, joined_stride()};
    return {tile.hidden.data(), width_};
}

template <class T>
typename PackedField<T>::template Rows<const T> PackedField<T>::last_output(
    const FieldTile<T>& tile) const {
    if ((layers_.size() - 1 + skip_layer_) % 2 == 1)
        return {tile.joined.data() + encoding_, joined_stride()};
    return {tile.hidden.data(), width_};
}

template <class T>
void PackedField<T>::reserve(std::int64_t points, FieldTile<T>& tile) const {
    grow(tile.joined, points * joined_stride());
    grow(tile.hidden, points * width_);
    grow(tile.phases, points_at_once * 9 * frequencies_ + encoding_);
    grow(tile.logits, points);
    grow(tile.features, points * width_);
}

template <class T>
void PackedField<T>::take_logits(std::int64_t points, FieldTile<T>& tile) const {
    const Rows<const T> last = last_output(tile);
    for (std::int64_t i = 0; i < points; ++i)
        tile.logits[static_cast<std::size_t>(i)] =
            dot(last.data + i * last.stride, density_weight_.data(), width_) + density_bias_;
}

template <class T>
void PackedField<T>::evaluate(std::span<const T> points, FieldTile<T>& tile,
                              const SineArgumentRows<T>& arguments) const {
    const std::int64_t count = static_cast<std::int64_t>(points.size()) / 3;
    work::count_field_points(count);
    reserve(count, tile);
    encode(points, tile);
    for (std::size_t i = 0; i < layers_.size(); ++i) {
        const Rows<T> from =
            reads_encoding(i) ? Rows<T>{tile.joined.data(), joined_stride()} : output(i - 1, tile);
        const Rows<T> to = output(i, tile);
        const kernels::LeftMatrix<T> left{from.data, from.stride};
        if (arguments.data != nullptr) {
            layers_[i].apply(arguments.layer(i), width_, left, count, Activation::none);
            take_sines(arguments.layer(i), to.data, to.stride, count, width_);
        } else {
            layers_[i].apply(to.data, to.stride, left, count, layers_[i].activation);
        }
    }
    take_logits(count, tile);
}

template <class T>
void PackedField<T>::evaluate(const T* arguments, std::int64_t points, FieldTile<T>& tile) const {
    const Rows<T> last = output(layers_.size() - 1, tile);
    take_sines(arguments, last.data, last.stride, points, width_);
    take_logits(points, tile);
}

template <class T>
void PackedField<T>::feature_arguments(std::int64_t points, const FieldTile<T>& tile,
                                       T* result) const {
    const Rows<const T> last = last_output(tile);
    feature_.apply(result, width_, {last.data, last.stride}, points, Activation::none);
}

template <class T>
void PackedField<T>::features(std::int64_t points, FieldTile<T>& tile,
                              const SineArgumentRows<T>& arguments) const {
    if (arguments.data != nullptr) {
        T* const kept = arguments.layer(layers_.size());
        feature_arguments(points, tile, kept);
        take_sines(kept, tile.features.data(), width_, points, width_);
        return;
    }
    const Rows<const T> last = last_output(tile);
    feature_.apply(tile.features.data(), width_, {last.data, last.stride}, points,
                   feature_.activation);
}

template <class T>
void PackedField<T>::features(std::span<const std::int32_t> points, FieldTile<T>& tile) const {
    const auto count = static_cast<std::int64_t>(points.size());
    if (count == 0) return;
    const Rows<T> last = output(layers_.size() - 1, tile);
    // Since `points` ascends, a copied row never overwrites a row that is still to be read.
    const bool all = points.back() == count - 1;
    for (std::int64_t i = 0; !all && i < count; ++i) {
        const T* from = last.data + points[static_cast<std::size_t>(i)] * last.stride;
        std::copy_n(from, width_, last.data + i * last.stride);
    }
    features(count, tile);
}

template <class T>
void PackedField<T>::apply_last_layer(std::span<const T> composited, std::span<const T> opacities,
                                      std::span<T> result) const {
    const auto rays = static_cast<std::int64_t>(opacities.size()), channels = feature_channels();
    for (std::int64_t ray = 0; ray < rays; ++ray) {
        const T opacity = opacities[static_cast<std::size_t>(ray)];
        for (std::int64_t i = 0; i < channels; ++i)
            result[static_cast<std::size_t>(ray * channels + i)] =
                opacity * last_layer_.bias[static_cast<std::size_t>(i)];
    }
    kernels::multiply_packed(result.data(), channels,
                             kernels::LeftMatrix<T>{composited.data(), width_}, rays,
                             last_layer_.weight, kernels::Epilogue<T>{.present_values = true});
}

template class PackedField<float>;
template class PackedField<double>;

}  // namespace stymo
