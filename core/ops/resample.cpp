#include "core/ops/resample.h"

#include <algorithm>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/kernels/blur_upsampled.h"
#include "core/kernels/resample.h"
#include "core/kernels/shape.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"
#include "core/parallel.h"

namespace stymo {

Variable resample(const Variable& x, const ResampleMatrix& vertical,
                  const ResampleMatrix& horizontal) {
    if (x.rank() != 4 || x.shape(1) != vertical.input_length() ||
        x.shape(2) != horizontal.input_length())
        fail<ShapeError>("[resample] image ", x.shape(), " for matrices that take ",
                         vertical.input_length(), " rows and ", horizontal.input_length(),
                         " columns");
    return record("resample", kernels::resample(x.value(), vertical, horizontal), {x}, Save::none(),
                  {[vertical, horizontal](const Vjp& v) {
                      return resample(v.grad(), vertical.transposed(), horizontal.transposed());
                  }});
}

ResampleMatrix upfirdn_matrix(int input_length, std::span<const double> filter, int up, int down,
                              int pad_before, int pad_after) {
    const int taps = static_cast<int>(filter.size());
    if (up < 1 || down < 1 || taps == 0)
        fail<ValueError>("[upfirdn] up ", up, ", down ", down, ", ", taps,
                         " taps; each must be at least 1");
    const int filtered = input_length * up + pad_before + pad_after - taps + 1;
    if (filtered < 1)
        fail<ShapeError>("[upfirdn] ", taps, " taps do not fit ", input_length,
                         " elements with padding ", pad_before, ", ", pad_after);
    const int output_length = (filtered + down - 1) / down;
    std::vector<ResampleMatrix::Entry> entries;
    for (int output = 0; output < output_length; ++output) {
        for (int tap = 0; tap < taps; ++tap) {
            const int upsampled = output * down + tap - pad_before;
            if (upsampled < 0 || upsampled % up != 0 || upsampled / up >= input_length) continue;
            entries.push_back(
                {output, upsampled / up, filter[static_cast<std::size_t>(taps - 1 - tap)]});
        }
    }
    return {output_length, input_length, std::move(entries)};
}

ResampleMatrix blur_matrix(int length) {
    std::vector<ResampleMatrix::Entry> entries;
    for (int i = 0; i < length; ++i) {
        const int before = i > 0 ? i - 1 : std::min(1, length - 1);
        const int after = i + 1 < length ? i + 1 : std::max(0, length - 2);
        entries.push_back({i, before, 0.25});
        entries.push_back({i, i, 0.5});
        entries.push_back({i, after, 0.25});
    }
    return {length, length, std::move(entries)};
}

ResampleMatrix bilinear_matrix(int output_length, int input_length) {
    std::vector<ResampleMatrix::Entry> entries;
    const double scale = static_cast<double>(input_length) / output_length;
    for (int i = 0; i < output_length; ++i) {
        const double position = std::max(0.0, (i + 0.5) * scale - 0.5);
        const int low = std::min(static_cast<int>(position), input_length - 1);
        const double fraction = position - low;
        entries.push_back({i, low, 1.0 - fraction});
        if (fraction > 0.0) entries.push_back({i, std::min(low + 1, input_length - 1), fraction});
    }
    return {output_length, input_length, std::move(entries)};
}

namespace {

/// Cubic convolution kernel (Keys 1981) with a = -0.5.
double cubic(double distance) {
    constexpr double a = -0.5;
    const double x = std::abs(distance);
    if (x < 1.0) return ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0;
    if (x < 2.0) return (((x - 5.0) * x + 8.0) * x - 4.0) * a;
    return 0.0;
}

}  // namespace

ResampleMatrix bicubic_matrix(int output_length, int input_length) {
    std::vector<ResampleMatrix::Entry> entries;
    const double scale = static_cast<double>(input_length) / output_length;
    const double stretch = std::max(1.0, scale);
    for (int i = 0; i < output_length; ++i) {
        const double center = (i + 0.5) * scale;
        const int first = std::max(0, static_cast<int>(std::floor(center - 2.0 * stretch + 0.5)));
        const int last =
            std::min(input_length, static_cast<int>(std::floor(center + 2.0 * stretch + 0.5)));
        const std::size_t begin = entries.size();
        double total = 0.0;
        for (int j = first; j < last; ++j) {
            const double weight = cubic((j + 0.5 - center) / stretch);
            entries.push_back({i, j, weight});
            total += weight;
        }
        for (std::size_t entry = begin; entry < entries.size(); ++entry)
            entries[entry].weight /= total;
    }
    return {output_length, input_length, std::move(entries)};
}

ResampleMatrix box_matrix(int output_length, int input_length) {
    if (output_length == 0 && input_length == 0) return {0, 0, {}};
    if (output_length < 1 || input_length % output_length != 0)
        fail<ShapeError>("[resize_box] ", output_length, " does not divide ", input_length);
    const int factor = input_length / output_length;
    std::vector<ResampleMatrix::Entry> entries;
    for (int i = 0; i < input_length; ++i) entries.push_back({i / factor, i, 1.0 / factor});
    return {output_length, input_length, std::move(entries)};
}

namespace {

int height_of(const Variable& x) {
    return static_cast<int>(x.shape(1));
}
int width_of(const Variable& x) {
    return static_cast<int>(x.shape(2));
}

}  // namespace

Variable upfirdn2d(const Variable& x, std::span<const double> filter, int up, int down,
                   int pad_before, int pad_after) {
    return resample(x, upfirdn_matrix(height_of(x), filter, up, down, pad_before, pad_after),
                    upfirdn_matrix(width_of(x), filter, up, down, pad_before, pad_after));
}

Variable blur(const Variable& x) {
    return resample(x, blur_matrix(height_of(x)), blur_matrix(width_of(x)));
}

Variable resize_bilinear(const Variable& x, int height, int width) {
    return resample(x, bilinear_matrix(height, height_of(x)), bilinear_matrix(width, width_of(x)));
}

Variable resize_bicubic(const Variable& x, int height, int width) {
    return resample(x, bicubic_matrix(height, height_of(x)), bicubic_matrix(width, width_of(x)));
}

Variable resize_box(const Variable& x, int height, int width) {
    return resample(x, box_matrix(height, height_of(x)), box_matrix(width, width_of(x)));
}

Variable pixel_shuffle(const Variable& x) {
    if (x.rank() != 4 || x.shape(3) % 4 != 0)
        fail<ShapeError>("[pixel_shuffle] needs (b, h, w, 4c), got ", x.shape());
    return record("pixel_shuffle", kernels::pixel_shuffle(x.value()), {x}, Save::none(),
                  {[](const Vjp& v) { return pixel_unshuffle(v.grad()); }});
}

Variable pixel_shuffle_onto(const Variable& coarse, const Variable& x) {
    if (coarse.rank() != 4 || x.shape() != coarse.shape().with(3, 4 * coarse.shape(3)))
        fail<ShapeError>("[pixel_shuffle_onto] needs (b, h, w, c) and (b, h, w, 4c), got ",
                         coarse.shape(), " and ", x.shape());
    return record("pixel_shuffle_onto", kernels::pixel_shuffle(x.value(), coarse.value()),
                  {coarse, x}, Save::none(),
                  {[](const Vjp& v) {
                       const Variable& dL_dy = v.grad();
                       return resize_box(dL_dy, height_of(dL_dy) / 2, width_of(dL_dy) / 2) * 4.0;
                   },
                   [](const Vjp& v) { return pixel_unshuffle(v.grad()); }});
}

Variable pixel_unshuffle(const Variable& x) {
    if (x.rank() != 4 || x.shape(1) % 2 != 0 || x.shape(2) % 2 != 0)
        fail<ShapeError>("[pixel_unshuffle] needs an even height and width, got ", x.shape());
    return record("pixel_unshuffle", kernels::pixel_unshuffle(x.value()), {x}, Save::none(),
                  {[](const Vjp& v) { return pixel_shuffle(v.grad()); }});
}

namespace {

constexpr std::int64_t subpixels = 4;
/// Smallest number of elements for one thread.
constexpr std::int64_t grain = 32768;

void check(const Variable& x, const Variable& detail) {
    if (x.rank() != 4 || detail.shape() != x.shape().with(3, subpixels * x.shape(3)))
        fail<ShapeError>("[blur_upsampled] needs (B, h, w, C) and (B, h, w, 4 C), got ", x.shape(),
                         " and ", detail.shape());
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
