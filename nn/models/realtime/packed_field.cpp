#include "nn/models/realtime/packed_field.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/kernels/fast_math.h"
#include "nn/models/realtime/bfloat16.h"
#include "render/encoding.h"

namespace stymo {
namespace {

/// Channels of the encoding begin a row whose rest is to lie on a cache line.
constexpr std::int64_t encoding_multiple = 32;
constexpr std::size_t most_phases = 48;

template <class T>
void grow(std::vector<T>& buffer, std::int64_t size) {
    if (static_cast<std::int64_t>(buffer.size()) < size) buffer.resize(static_cast<std::size_t>(size));
}

std::vector<float> values(const Tensor& tensor) {
    const auto all = tensor.values<float>();
    return {all.begin(), all.end()};
}

/// max(x, 0) + log(1 + exp(-|x|))
float softplus_value(float x) {
    return std::max(x, 0.0F) + std::log1p(std::exp(-std::abs(x)));
}

template <class T>
float dot(const T* row, const float* weight, std::int64_t count) {
    float sum = 0.0F;
#pragma omp simd reduction(+ : sum)
    for (std::int64_t i = 0; i < count; ++i) sum += to_float(row[i]) * weight[i];
    return sum;
}

}  // namespace

template <class T>
typename PackedField<T>::Layer PackedField<T>::pack(const FoldedLayer& layer) {
    const std::int64_t out = layer.weight.shape(0), in = layer.weight.shape(1);
    return {kernels::PackedMatrix<T>(layer.weight.values<float>().data(), in, out, 1, in), values(layer.bias), layer.activation};
}

/// Encoded channels come as (x, all sines, all cosines, zeros): vectors of sines and of cosines are then stored as they are.
template <class T>
typename PackedField<T>::Layer PackedField<T>::pack_encoded(const FoldedLayer& layer) const {
    const std::int64_t out = layer.weight.shape(0), in = layer.weight.shape(1);
    const std::int64_t encoded = encoded_channels(frequencies_);
    const std::int64_t in_packed = encoding_ + in - encoded;
    const std::span<const float> from = layer.weight.values<float>();
    std::vector<float> to(static_cast<std::size_t>(out * in_packed), 0.0F);
    for (std::int64_t row = 0; row < out; ++row) {
        const float* old_row = from.data() + row * in;
        float* new_row = to.data() + row * in_packed;
        std::copy_n(old_row, 3, new_row);
        for (std::int64_t octave = 0; octave < frequencies_; ++octave) {
            std::copy_n(old_row + 3 + 6 * octave, 3, new_row + 3 + 3 * octave);
            std::copy_n(old_row + 6 + 6 * octave, 3, new_row + 3 + 3 * (frequencies_ + octave));
        }
        std::copy_n(old_row + encoded, in - encoded, new_row + encoding_);
    }
    return {kernels::PackedMatrix<T>(to.data(), in_packed, out, 1, in_packed), values(layer.bias), layer.activation};
}

template <class T>
PackedField<T>::PackedField(const FoldedField& field)
    : width_(field.layers.front().weight.shape(0)),
      frequencies_(field.frequencies),
      encoding_((encoded_channels(field.frequencies) + encoding_multiple - 1) / encoding_multiple * encoding_multiple),
      skip_layer_(field.skip_layer),
      density_weight_(values(field.density.weight)),
      density_bias_(values(field.density.bias).front() - 1.0F),
      feature_(pack(field.feature0)),
      finish_(field.feature1.weight.values<float>().data(), field.feature1.weight.shape(1), field.feature1.weight.shape(0), 1,
              field.feature1.weight.shape(1)),
      finish_bias_(values(field.feature1.bias)) {
    for (std::size_t i = 0; i < field.layers.size(); ++i) {
        const bool encoded = i == 0 || i == skip_layer_;
        layers_.push_back(encoded ? pack_encoded(field.layers[i]) : pack(field.layers[i]));
    }
}

template <class T>
void PackedField<T>::encode(std::span<const float> points, FieldTile<T>& tile) const {
    const std::int64_t count = static_cast<std::int64_t>(points.size()) / 3, stride = encoding_ + width_;
    const std::int64_t phase_count = 3 * frequencies_;
    std::array<float, most_phases> phases{};
    for (std::int64_t point = 0; point < count; ++point) {
        const float* x = points.data() + 3 * point;
        T* row = tile.joined.data() + point * stride;
        float frequency = 1.0F;
        for (std::int64_t octave = 0; octave < frequencies_; ++octave, frequency *= 2.0F) {
            for (std::int64_t axis = 0; axis < 3; ++axis) phases[static_cast<std::size_t>(3 * octave + axis)] = x[axis] * frequency;
        }
        for (std::int64_t axis = 0; axis < 3; ++axis) row[axis] = narrowed<T>(x[axis]);
        T* sines = row + 3;
        T* cosines = sines + phase_count;
        kernels::for_each_sine_cosine(phases.data(), phase_count, [=](std::int64_t i, float sine, float cosine) {
            sines[i] = narrowed<T>(sine);
            cosines[i] = narrowed<T>(cosine);
        });
        std::fill(cosines + phase_count, row + encoding_, T{});
    }
}

/// Layers write to one buffer and the other in turn, such that the layer before the skip layer writes beside the encoding.
template <class T>
typename PackedField<T>::template Rows<T> PackedField<T>::output(std::size_t layer, FieldTile<T>& tile) const {
    if ((layer + skip_layer_) % 2 == 1) return {tile.joined.data() + encoding_, encoding_ + width_};
    return {tile.hidden.data(), width_};
}

template <class T>
void PackedField<T>::density(std::span<const float> points, FieldTile<T>& tile) const {
    const std::int64_t count = static_cast<std::int64_t>(points.size()) / 3, joined = encoding_ + width_;
    grow(tile.joined, count * joined);
    grow(tile.hidden, count * width_);
    grow(tile.density, count);
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
            softplus_value(dot(last.data + i * last.stride, density_weight_.data(), width_) + density_bias_);
    }
}

template <class T>
void PackedField<T>::features(std::span<const std::int32_t> rows, FieldTile<T>& tile) const {
    const auto count = static_cast<std::int64_t>(rows.size());
    if (count == 0) return;
    grow(tile.features, count * width_);
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
            result[static_cast<std::size_t>(ray * channels + i)] = opacity * finish_bias_[static_cast<std::size_t>(i)];
    }
    kernels::multiply_packed(result.data(), channels, kernels::LeftMatrix<float>{composited.data(), width_}, rays, finish_,
                             {.present_values = true});
}

template class PackedField<float>;
template class PackedField<kernels::BFloat16>;

}  // namespace stymo
