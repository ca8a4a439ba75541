#include <algorithm>
#include <vector>

#include "core/kernels/conv_algorithms.h"
#include "core/parallel.h"

namespace stymo::kernels {

namespace {

/// Output rows of one chunk.
std::int64_t band(const ConvGeometry& g) {
    return std::max<std::int64_t>(1, 1024 / std::max<std::int64_t>(1, g.out_width));
}

/// Calls visit(output row, output column, tap, offset of the input pixel) for output rows
/// [first, last), for every tap inside the image.
template <class Visit>
void for_each_pair(const ConvGeometry& g, std::int64_t first, std::int64_t last, Visit visit) {
    for (std::int64_t out_row = first; out_row < last; ++out_row) {
        for (std::int64_t kernel_row = 0; kernel_row < g.kernel_height; ++kernel_row) {
            const std::int64_t row = out_row * g.stride + kernel_row - g.padding;
            if (row < 0 || row >= g.in_height) continue;
            for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
                for (std::int64_t kernel_column = 0; kernel_column < g.kernel_width;
                     ++kernel_column) {
                    const std::int64_t column = out_column * g.stride + kernel_column - g.padding;
                    if (column < 0 || column >= g.in_width) continue;
                    visit((out_row * g.out_width + out_column) * g.out_channels,
                          kernel_row * g.kernel_width + kernel_column, row, column);
                }
            }
        }
    }
}

/// Weights (channels, taps) turned to (taps, channels).
template <class T>
std::vector<T> by_tap(const T* weight, const ConvGeometry& g) {
    const std::int64_t taps = g.kernel_height * g.kernel_width;
    std::vector<T> result(static_cast<std::size_t>(taps * g.in_channels));
    for (std::int64_t c = 0; c < g.in_channels; ++c) {
        for (std::int64_t tap = 0; tap < taps; ++tap)
            result[static_cast<std::size_t>(tap * g.in_channels + c)] = weight[c * taps + tap];
    }
    return result;
}

template <class T>
void add_products(const T* a, const T* b, T* sum, std::int64_t channels) {
    for (std::int64_t c = 0; c < channels; ++c) sum[c] += a[c] * b[c];
}

}  // namespace

template <class T>
void depthwise_conv2d(const T* x, const T* weight, const ConvFinish<T>& finish, T* y,
                      const ConvGeometry& g) {
    const std::vector<T> weights = by_tap(weight, g);
    const std::int64_t channels = g.in_channels;
    const std::int64_t bands = chunk_count(g.out_height, band(g));
    parallel_for(g.batch * bands, 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t first = index % bands * band(g);
        const std::int64_t last = std::min(g.out_height, first + band(g));
        const T* image = x + index / bands * g.input_image();
        T* to = y + index / bands * g.output_image();
        std::fill_n(to + first * g.out_width * channels, (last - first) * g.out_width * channels,
                    T(0));
        for_each_pair(
            g, first, last,
            [&](std::int64_t out, std::int64_t tap, std::int64_t row, std::int64_t column) {
                add_products(weights.data() + tap * channels,
                             image + (row * g.in_width + column) * channels, to + out, channels);
            });
        finish.apply(to + first * g.out_width * channels, (last - first) * g.out_width, channels);
    });
}

template <class T>
void depthwise_conv2d_transpose(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g) {
    const std::vector<T> weights = by_tap(weight, g);
    const std::int64_t channels = g.in_channels;
    // Bands of input rows: each is written by one thread only.
    const std::int64_t rows = band(g) * g.stride;
    const std::int64_t bands = chunk_count(g.in_height, rows);
    parallel_for(g.batch * bands, 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t first = index % bands * rows;
        const std::int64_t last = std::min(g.in_height, first + rows);
        const std::int64_t low = std::max<std::int64_t>(0, first + g.padding - g.kernel_height + 1);
        const T* from = dL_dy + index / bands * g.output_image();
        T* image = dL_dx + index / bands * g.input_image();
        std::fill_n(image + first * g.in_width * channels, (last - first) * g.in_width * channels,
                    T(0));
        for_each_pair(
            g, chunk_count(low, g.stride),
            std::min(g.out_height, (last - 1 + g.padding) / g.stride + 1),
            [&](std::int64_t out, std::int64_t tap, std::int64_t row, std::int64_t column) {
                if (row < first || row >= last) return;
                add_products(weights.data() + tap * channels, from + out,
                             image + (row * g.in_width + column) * channels, channels);
            });
    });
}

template <class T>
void depthwise_conv2d_weight_grad(const T* dL_dy, const T* x, T* dL_dweight,
                                  const ConvGeometry& g) {
    // A few fixed runs of bands, each with its own sum: their number bounds the memory and does not
    // depend on the threads.
    constexpr std::int64_t runs = 8;
    const std::int64_t bands = chunk_count(g.out_height, band(g));
    const std::int64_t run = std::max<std::int64_t>(1, chunk_count(g.batch * bands, runs));
    const std::int64_t used = chunk_count(g.batch * bands, run);
    const std::int64_t channels = g.in_channels;
    const std::int64_t taps = g.kernel_height * g.kernel_width;
    std::vector<T> partial(static_cast<std::size_t>(used * taps * channels), T(0));
    parallel_for(g.batch * bands, run, [&](std::int64_t begin, std::int64_t end) {
        T* sum = partial.data() + begin / run * taps * channels;
        for (std::int64_t index = begin; index < end; ++index) {
            const std::int64_t first = index % bands * band(g);
            const T* from = dL_dy + index / bands * g.output_image();
            const T* image = x + index / bands * g.input_image();
            for_each_pair(
                g, first, std::min(g.out_height, first + band(g)),
                [&](std::int64_t out, std::int64_t tap, std::int64_t row, std::int64_t column) {
                    add_products(from + out, image + (row * g.in_width + column) * channels,
                                 sum + tap * channels, channels);
                });
        }
    });
    for (std::int64_t c = 0; c < channels; ++c) {
        for (std::int64_t tap = 0; tap < taps; ++tap) {
            T total = T(0);
            for (std::int64_t part = 0; part < used; ++part)
                total += partial[static_cast<std::size_t>((part * taps + tap) * channels + c)];
            dL_dweight[c * taps + tap] = total;
        }
    }
}

template void depthwise_conv2d(const float*, const float*, const ConvFinish<float>&, float*,
                               const ConvGeometry&);
template void depthwise_conv2d(const double*, const double*, const ConvFinish<double>&, double*,
                               const ConvGeometry&);
template void depthwise_conv2d_transpose(const float*, const float*, float*, const ConvGeometry&);
template void depthwise_conv2d_transpose(const double*, const double*, double*,
                                         const ConvGeometry&);
template void depthwise_conv2d_weight_grad(const float*, const float*, float*, const ConvGeometry&);
template void depthwise_conv2d_weight_grad(const double*, const double*, double*,
                                           const ConvGeometry&);

}  // namespace stymo::kernels
