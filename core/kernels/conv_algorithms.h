#pragma once

#include <cstdint>

#include "core/op_options.h"
#include "core/shape.h"

namespace stymo::kernels {

/// All extents of a convolution.
struct ConvGeometry {
    std::int64_t batch, in_height, in_width, in_channels;
    std::int64_t out_height, out_width, out_channels;
    std::int64_t kernel_height, kernel_width;
    std::int64_t stride, padding, groups;

    /// From the shapes of the input, the weight and the output.
    ConvGeometry(const Shape& x, const Shape& weight, const Shape& y, const Conv2dOptions& options)
        : batch(x[0]),
          in_height(x[1]),
          in_width(x[2]),
          in_channels(x[3]),
          out_height(y[1]),
          out_width(y[2]),
          out_channels(y[3]),
          kernel_height(weight[1]),
          kernel_width(weight[2]),
          stride(options.stride),
          padding(options.padding),
          groups(options.groups) {}

    [[nodiscard]] std::int64_t group_in() const { return in_channels / groups; }
    [[nodiscard]] std::int64_t group_out() const { return out_channels / groups; }
    [[nodiscard]] std::int64_t input_image() const { return in_height * in_width * in_channels; }
    [[nodiscard]] std::int64_t output_image() const {
        return out_height * out_width * out_channels;
    }
    /// Number of weights of one filter, which is the inner length of the products.
    [[nodiscard]] std::int64_t filter_size() const {
        return kernel_height * kernel_width * group_in();
    }
    [[nodiscard]] bool depthwise() const {
        return groups > 1 && group_in() == 1 && group_out() == 1;
    }
};

/// Applied to the result of a convolution while it is in cache: leaky_relu(result + bias, slope).
template <class T>
struct ConvFinish {
    const T* bias = nullptr;  ///< one number for each channel; null: none
    T slope = 1;              ///< 1: no activation

    void apply(T* pixels, std::int64_t count, std::int64_t channels) const {
        const T* const offsets = bias;
        const T factor = slope;
        for (std::int64_t i = 0; i < count; ++i, pixels += channels) {
            if (offsets != nullptr) {
#pragma omp simd
                for (std::int64_t c = 0; c < channels; ++c) pixels[c] += offsets[c];
            }
            if (factor == T(0)) {  // 0 times an overflow would be NaN
#pragma omp simd
                for (std::int64_t c = 0; c < channels; ++c)
                    pixels[c] = pixels[c] <= T(0) ? T(0) : pixels[c];
            } else if (factor != T(1)) {
#pragma omp simd
                for (std::int64_t c = 0; c < channels; ++c)
                    pixels[c] *= pixels[c] > T(0) ? T(1) : factor;
            }
        }
    }
};

/// Applied to the result's gradient in the backward pass: leaky_gate(dL_dy, signs, slope, 1).
template <class T>
struct ConvGate {
    const T* signs = nullptr;  ///< has the shape of the result; null: the gradient is not changed
    T slope = 1;
};

// The three convolutions of core/ops/conv.h on contiguous arrays, in three ways. Results do not
// depend on the number of threads. T: float, double.

// Of any geometry: as matrix products of unfolded pixels (im2col) and packed filters.

template <class T>
void direct_conv2d(const T* x, const T* weight, const ConvFinish<T>& finish, T* y,
                   const ConvGeometry& g);
template <class T>
void direct_conv2d_transpose(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g);
template <class T>
void direct_conv2d_weight_grad(const T* dL_dy, const T* x, T* dL_dweight, const ConvGeometry& g);

// Depthwise: each group has one input and one output channel. The loop over channels is innermost
// and contiguous.

template <class T>
void depthwise_conv2d(const T* x, const T* weight, const ConvFinish<T>& finish, T* y,
                      const ConvGeometry& g);
template <class T>
void depthwise_conv2d_transpose(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g);
template <class T>
void depthwise_conv2d_weight_grad(const T* dL_dy, const T* x, T* dL_dweight, const ConvGeometry& g);

// 3x3, of stride 1, in float32: by Winograd's minimal filtering F(4x4, 3x3) (Lavin and Gray, "Fast
// Algorithms for Convolutional Neural Networks", 2016), a quarter of the multiplications of the
// direct form, as 36 independent matrix products for each block of tiles. The interpolation points
// are 0, +-a, +-b and infinity.

/// Whether these functions support the convolution: 3x3, stride 1, one group, channels in multiples
/// of 16.
[[nodiscard]] bool winograd_serves(const ConvGeometry& g);
/// Whether they are also faster than the direct form: there are enough output pixels to compensate
/// for the transformation of the filters.
[[nodiscard]] bool winograd_pays(const ConvGeometry& g);

void winograd_conv2d(const float* x, const float* weight, const ConvFinish<float>& finish, float* y,
                     const ConvGeometry& g);
void winograd_conv2d_transpose(const float* dL_dy, const ConvGate<float>& gate, const float* weight,
                               float* dL_dx, const ConvGeometry& g);
void winograd_conv2d_weight_grad(const float* dL_dy, const float* x, float* dL_dweight,
                                 const ConvGeometry& g);

}  // namespace stymo::kernels
