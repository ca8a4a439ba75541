#include "core/kernels/conv.h"

#include "core/kernels/conv_algorithms.h"
#include "core/kernels/elementwise.h"

namespace stymo::kernels {

namespace {

/// Winograd convolutions round differently, so float64, in which gradients are checked, uses the
/// direct form.
template <class T>
constexpr bool minimal_filtering = std::is_same_v<T, float>;

}  // namespace

Tensor conv2d(const Tensor& x, const Tensor& weight, const Tensor& bias, double slope,
              const Shape& output_shape, const Conv2dOptions& options) {
    const ConvGeometry g(x.shape(), weight.shape(), output_shape, options);
    Tensor y(output_shape, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        const T* w = weight.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const ConvFinish<T> finish{bias.defined() ? bias.values<T>().data() : nullptr,
                                   static_cast<T>(slope)};
        if (g.depthwise()) return depthwise_conv2d(in, w, finish, out, g);
        if constexpr (minimal_filtering<T>) {
            if (winograd_pays(g)) return winograd_conv2d(in, w, finish, out, g);
        }
        direct_conv2d(in, w, finish, out, g);
    });
    return y;
}

Tensor conv2d_transpose(const Tensor& dL_dy, const Tensor& weight, const Shape& input_shape,
                        const Conv2dOptions& options) {
    const ConvGeometry g(input_shape, weight.shape(), dL_dy.shape(), options);
    if (dL_dy.size() == 0) return Tensor::zeros(input_shape, dL_dy.dtype());
    Tensor dL_dx(input_shape, dL_dy.dtype());
    dispatch(dL_dy.dtype(), [&]<class T>(T) {
        const T* gradient = dL_dy.values<T>().data();
        const T* w = weight.values<T>().data();
        T* out = dL_dx.mutable_values<T>().data();
        if (g.depthwise()) return depthwise_conv2d_transpose(gradient, w, out, g);
        if constexpr (minimal_filtering<T>) {
            if (winograd_pays(g)) return winograd_conv2d_transpose(gradient, {}, w, out, g);
        }
        direct_conv2d_transpose(gradient, w, out, g);
    });
    return dL_dx;
}

Tensor conv2d_gated_transpose(const Tensor& dL_dy, const Tensor& y, double slope,
                              const Tensor& weight, const Shape& input_shape,
                              const Conv2dOptions& options) {
    const ConvGeometry g(input_shape, weight.shape(), dL_dy.shape(), options);
    if (dL_dy.dtype() != DType::float32 || !winograd_pays(g))
        return conv2d_transpose(leaky_gate(dL_dy, y, slope, 1.0), weight, input_shape, options);
    Tensor dL_dx(input_shape, dL_dy.dtype());
    winograd_conv2d_transpose(
        dL_dy.values<float>().data(), {y.values<float>().data(), static_cast<float>(slope)},
        weight.values<float>().data(), dL_dx.mutable_values<float>().data(), g);
    return dL_dx;
}

Tensor conv2d_weight_grad(const Tensor& dL_dy, const Tensor& x, const Shape& weight_shape,
                          const Conv2dOptions& options) {
    const ConvGeometry g(x.shape(), weight_shape, dL_dy.shape(), options);
    Tensor dL_dweight(weight_shape, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* gradient = dL_dy.values<T>().data();
        const T* in = x.values<T>().data();
        T* out = dL_dweight.mutable_values<T>().data();
        if (g.depthwise()) return depthwise_conv2d_weight_grad(gradient, in, out, g);
        if constexpr (minimal_filtering<T>) {
            if (winograd_pays(g)) return winograd_conv2d_weight_grad(gradient, in, out, g);
        }
        direct_conv2d_weight_grad(gradient, in, out, g);
    });
    return dL_dweight;
}

}  // namespace stymo::kernels
