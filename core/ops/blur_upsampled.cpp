#include "core/ops/blur_upsampled.h"

#include <algorithm>

#include "core/autograd/grad.h"
#include "core/autograd/record.h"
#include "core/error.h"
#include "core/kernels/blur_upsampled.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"
#include "core/parallel.h"

namespace stymo {

namespace {

constexpr std::int64_t subpixels = 4;
/// Smallest number of elements for one thread.
constexpr std::int64_t grain = 32768;

void check(const Variable& x, const Variable& detail) {
    if (x.rank() != 4 || detail.shape() != x.shape().with(3, subpixels * x.shape(3))) {
        fail<ShapeError>("[blur_upsampled] needs (B, h, w, C) and (B, h, w, 4 C), got ", x.shape(),
                         " and ", detail.shape());
    }
}

/// Calls body(image, row) for all rows of all images.
template <class Body>
void for_each_row(const Shape& shape, const Body& body) {
    const std::int64_t height = shape[1];
    const std::int64_t row_size = std::max<std::int64_t>(1, shape.product(2, 4) * subpixels);
    parallel_for(shape[0] * height, std::max<std::int64_t>(1, grain / row_size),
                 [&](std::int64_t begin, std::int64_t end) {
                     for (std::int64_t i = begin; i < end; ++i) body(i / height, i % height);
                 });
}

Tensor upsampled(const Tensor& x, const Tensor& detail) {
    const std::int64_t height = x.shape(1), width = x.shape(2), channels = x.shape(3);
    Tensor y(x.shape().with(1, 2 * height).with(2, 2 * width), DType::float32);
    const float* const features = x.values<float>().data();
    const float* const details = detail.values<float>().data();
    float* const out = y.mutable_values<float>().data();
    for_each_row(x.shape(), [&](std::int64_t image, std::int64_t row) {
        const auto source = [&](std::int64_t beside) {
            const std::int64_t at =
                image * height + std::clamp<std::int64_t>(row + beside, 0, height - 1);
            return kernels::DetailedRow{0, width, features + at * width * channels,
                                        details + at * width * subpixels * channels};
        };
        const std::int64_t size = 2 * width * channels;
        float* const upper = out + (image * height + row) * 2 * size;
        kernels::blur_upsampled_rows(
            kernels::RowUpsampling{source(-1),
                                   source(0),
                                   source(1),
                                   {kernels::UpsampledRow{0, 2 * width, upper},
                                    kernels::UpsampledRow{0, 2 * width, upper + size}},
                                   width,
                                   channels});
    });
    return y;
}

std::vector<Variable> gradients(const Tensor& dL_dy, const Shape& shape) {
    const std::int64_t height = shape[1], width = shape[2], channels = shape[3];
    Tensor dL_dx(shape, DType::float32);
    Tensor dL_ddetail(shape.with(3, subpixels * channels), DType::float32);
    const float* const in = dL_dy.values<float>().data();
    float* const dL_dfeatures = dL_dx.mutable_values<float>().data();
    float* const dL_ddetails = dL_ddetail.mutable_values<float>().data();
    for_each_row(shape, [&](std::int64_t image, std::int64_t row) {
        const std::int64_t at = (image * height + row) * width;
        kernels::differentiate_blur_upsampled_row(
            {in + image * height * width * subpixels * channels, dL_dfeatures + at * channels,
             dL_ddetails + at * subpixels * channels, row, height, width, channels});
    });
    return {Variable(dL_dx), Variable(dL_ddetail)};
}

}  // namespace

Variable blur_upsampled_reference(const Variable& x, const Variable& detail) {
    check(x, detail);
    const std::int64_t pixels = x.shape().product(0, 3), channels = x.shape(3);
    const Variable by_channel =
        reshape(permute(reshape(detail, {pixels, subpixels, channels}), {0, 2, 1}), detail.shape());
    return blur(pixel_shuffle_onto(x, by_channel));
}

Variable blur_upsampled(const Variable& x, const Variable& detail) {
    check(x, detail);
    if (x.dtype() != DType::float32) return blur_upsampled_reference(x, detail);
    const Tensor value = upsampled(x.value(), detail.value());
    if (!x.tracked() && !detail.tracked()) return Variable(value);
    return record(
        "blur_upsampled", value,
        {Node::Input{x.node(), {}, x.shape()}, Node::Input{detail.node(), {}, detail.shape()}},
        [](const Vjp& v, const std::vector<bool>&) {
            if (!v.create_graph()) return gradients(v.grad().value(), v.shape(0));
            // The map is linear, so its gradient can be taken at any point, here at 0.
            const Variable anywhere = Variable::leaf(Tensor::zeros(v.shape(0))),
                           anything = Variable::leaf(Tensor::zeros(v.shape(1)));
            const std::vector<Variable> inputs{anywhere, anything};
            return grad(blur_upsampled_reference(anywhere, anything), inputs,
                        {.create_graph = true, .partial = true, .dL_dy = v.grad()});
        });
}

}  // namespace stymo
