#include "nn/models/realtime/packed_field.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/kernels/doubling.h"
#include "core/kernels/fast_math.h"
#include "core/parallel.h"
#include "core/work_counts.h"
#include "nn/models/realtime/softplus.h"
#include "render/encoding.h"

namespace stymo {
namespace {

/// Channels of the encoding begin a row whose rest is to lie on a cache line.
constexpr std::int64_t encoding_multiple = 32;
/// Points whose phases fill whole vectors together, which those of one point do not.
constexpr std::int64_t points_at_once = 8;
constexpr std::int64_t most_phases = 48;
constexpr std::size_t most_channels = 128;

template <class T>
void grow(std::vector<T>& buffer, std::int64_t size) {
    if (static_cast<std::int64_t>(buffer.size()) < size) buffer.resize(static_cast<std::size_t>(size));
}

std::vector<float> values(const Tensor& tensor) {
    const auto all = tensor.values<float>();
    return {all.begin(), all.end()};
}

/// `x` itself, or a wider copy of it.
const float* as_floats(const float* x, std::int64_t, float*) {
    return x;
}
template <class T>
const float* as_floats(const T* x, std::int64_t count, float* buffer) {
    kernels::widen(buffer, x, count);
    return buffer;
}

float dot(const float* row, const float* weight, std::int64_t count) {
    float sum = 0.0F;
#pragma omp simd reduction(+ : sum)
    for (std::int64_t i = 0; i < count; ++i) sum += row[i] * weight[i];
    return sum;
}

}  // namespace

/// Encoded channels come as (x, all sines, all cosines, zeros): vectors of sines and of cosines are then stored as they are.
template <class T>
FoldedLayer PackedField<T>::with_encoding_reordered(const FoldedLayer& layer) const {
    const std::int64_t out = layer.weight.shape(0), in = layer.weight.shape(1);
    const std::int64_t encoded = encoded_channels(frequencies_), reordered = encoding_ + in - encoded;
    FoldedLayer result{Tensor::zeros({out, reordered}), layer.bias, layer.activation};
    const float* from = layer.weight.values<float>().data();
    float* to = result.weight.mutable_values<float>().data();
    for (std::int64_t row = 0; row < out; ++row, from += in, to += reordered) {
        std::copy_n(from, 3, to);
        for (std::int64_t octave = 0; octave < frequencies_; ++octave) {
            std::copy_n(from + 3 + 6 * octave, 3, to + 3 + 3 * octave);
            std::copy_n(from + 6 + 6 * octave, 3, to + 3 + 3 * (frequencies_ + octave));
        }
        std::copy_n(from + encoded, in - encoded, to + encoding_);
    }
    return result;
}

template <class T>
PackedField<T>::PackedField(const FoldedField& field)
    : width_(field.layers.front().weight.shape(0)),
      frequencies_(field.frequencies),
      encoding_(chunk_count(encoded_channels(field.frequencies), encoding_multiple) * encoding_multiple),
      skip_layer_(field.skip_layer),
      density_weight_(values(field.density.weight)),
      density_bias_(values(field.density.bias).front() - 1.0F),
      feature_(field.feature0),
      finish_(field.feature1) {
    for (std::size_t i = 0; i < field.layers.size(); ++i) {
        const bool encoded = i == 0 || i == skip_layer_;
        layers_.emplace_back(encoded ? with_encoding_reordered(field.layers[i]) : field.layers[i]);
    }
}

template <class T>
void PackedField<T>::encode(std::span<const float> points, FieldTile<T>& tile) const {
    const std::int64_t count = static_cast<std::int64_t>(points.size()) / 3, stride = encoding_ + width_;
    const std::int64_t phase_count = 3 * frequencies_;
    std::array<float, points_at_once * most_phases> phases, sines, cosines;
    std::array<float, most_channels> row{};  // zeros beyond the cosines
    for (std::int64_t first = 0; first < count; first += points_at_once) {
        const std::int64_t last = std::min(count, first + points_at_once);
        float* phase = phases.data();
        for (std::int64_t point = first; point < last; ++point) {
            const float* x = points.data() + 3 * point;
            float frequency = 1.0F;
            for (std::int64_t octave = 0; octave < frequencies_; ++octave, frequency *= 2.0F) {
                for (std::int64_t axis = 0; axis < 3; ++axis) *phase++ = x[axis] * frequency;
            }
        }
        kernels::for_each_sine_cosine(phases.data(), phase - phases.data(), [&](std::int64_t i, float sine, float cosine) {
            sines[static_cast<std::size_t>(i)] = sine;
            cosines[static_cast<std::size_t>(i)] = cosine;
        });
        for (std::int64_t point = first; point < last; ++point) {
            std::copy_n(points.data() + 3 * point, 3, row.data());
            std::copy_n(sines.data() + (point - first) * phase_count, phase_count, row.data() + 3);
            std::copy_n(cosines.data() + (point - first) * phase_count, phase_count, row.data() + 3 + phase_count);
            kernels::narrow(tile.joined.data() + point * stride, row.data(), encoding_);
        }
    }
}

/// Layers write to one buffer and the other in turn, such that the layer before the skip layer writes beside the encoding.
template <class T>
typename PackedField<T>::template Rows<T> PackedField<T>::output(std::size_t layer, FieldTile<T>& tile) const {
    if ((layer + skip_layer_) % 2 == 1) return {tile.joined.data() + encoding_, encoding_ + width_};
    return {tile.hidden.data(), width_};
}

template <class T>
void PackedField<T>::reserve(std::int64_t points, FieldTile<T>& tile) const {
    grow(tile.joined, points * (encoding_ + width_));
    grow(tile.hidden, points * width_);
    grow(tile.density, points);
    grow(tile.features, points * width_);
}

template <class T>
void PackedField<T>::density(std::span<const float> points, FieldTile<T>& tile) const {
    const std::int64_t count = static_cast<std::int64_t>(points.size()) / 3, joined = encoding_ + width_;
    work::count_field_points(count);
    reserve(count, tile);
    encode(points, tile);
    for (std::size_t i = 0; i < layers_.size(); ++i) {
        const bool encoded = i == 0 || i == skip_layer_;
        const Rows<T> from = encoded ? Rows<T>{tile.joined.data(), joined} : output(i - 1, tile);
        const Rows<T> to = output(i, tile);
        kernels::multiply_packed(to.data, to.stride, kernels::LeftMatrix<T>{from.data, from.stride}, count, layers_[i].weight,
                                 {.bias = layers_[i].bias.data(), .activation = layers_[i].activation});
    }
    const Rows<T> last = output(layers_.size() - 1, tile);
    for (std::int64_t i = 0; i < count; ++i) {
        tile.density[static_cast<std::size_t>(i)] =
            softplus(dot(as_floats(last.data + i * last.stride, width_, tile.features.data()), density_weight_.data(), width_) +
                     density_bias_);
    }
}

template <class T>
void PackedField<T>::features(std::span<const std::int32_t> rows, FieldTile<T>& tile) const {
    const auto count = static_cast<std::int64_t>(rows.size());
    if (count == 0) return;
    const Rows<T> last = output(layers_.size() - 1, tile);
    // In ascending order a row never overwrites one that is still to be read.
    const bool all = rows.back() == count - 1;
    for (std::int64_t i = 0; !all && i < count; ++i) {
        const T* from = last.data + rows[static_cast<std::size_t>(i)] * last.stride;
        std::copy_n(from, width_, last.data + i * last.stride);
    }
    kernels::multiply_packed(tile.features.data(), width_, kernels::LeftMatrix<T>{last.data, last.stride}, count, feature_.weight,
                             {.bias = feature_.bias.data(), .activation = feature_.activation});
}

template <class T>
void PackedField<T>::finish(std::span<const float> composited, std::span<const float> opacities, std::span<float> result) const {
    const auto rays = static_cast<std::int64_t>(opacities.size()), channels = feature_channels();
    for (std::int64_t ray = 0; ray < rays; ++ray) {
        const float opacity = opacities[static_cast<std::size_t>(ray)];
        for (std::int64_t i = 0; i < channels; ++i)
            result[static_cast<std::size_t>(ray * channels + i)] = opacity * finish_.bias[static_cast<std::size_t>(i)];
    }
    kernels::multiply_packed(result.data(), channels, kernels::LeftMatrix<float>{composited.data(), width_}, rays, finish_.weight,
                             {.present_values = true});
}

template class PackedField<float>;
template class PackedField<kernels::BFloat16>;
template class PackedField<kernels::Float16>;

}  // namespace stymo
