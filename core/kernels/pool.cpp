#include "core/kernels/pool.h"

#include <algorithm>
#include <array>

#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

/// Calls body(output row, over all images) for every row of an image of this shape, on several
/// threads.
template <class Body>
void for_each_row(const Shape& shape, Body body) {
    const std::int64_t grain = std::max<std::int64_t>(
        1, elementwise_grain / std::max<std::int64_t>(1, shape.product(2, 4)));
    parallel_for(shape[0] * shape[1], grain, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t row = begin; row < end; ++row) body(row);
    });
}

/// Length of the part of a window from `start` that is inside the image.
std::int64_t clipped(std::int64_t start, std::int64_t length, int kernel) {
    return std::min<std::int64_t>(kernel, length - start);
}

/// One output pixel: `window` points at its first input pixel.
template <class T>
void choose_largest(const T* window, std::int64_t rows, std::int64_t columns, int kernel,
                    std::int64_t line, std::int64_t channels, T* largest, std::uint8_t* indices) {
    std::copy_n(window, channels, largest);
    std::fill_n(indices, channels, std::uint8_t{0});
    for (std::int64_t row = 0; row < rows; ++row) {
        for (std::int64_t column = 0; column < columns; ++column) {
            const T* pixel = window + row * line + column * channels;
            const auto index = static_cast<std::uint8_t>(row * kernel + column);
            for (std::int64_t c = 0; c < channels; ++c) {
                const bool better = pixel[c] > largest[c] || pixel[c] != pixel[c];
                largest[c] = better ? pixel[c] : largest[c];
                indices[c] = better ? index : indices[c];
            }
        }
    }
}

/// Adds those channels of one output pixel whose index lies in the window's row that begins at
/// index `first`; `row` points at the first of the `columns` input pixels of that row.
template <class T>
void add_to_row(const T* pixel, const std::uint8_t* indices, std::int64_t channels,
                std::int64_t first, std::int64_t columns, T* row) {
    for (std::int64_t column = 0; column < columns; ++column, row += channels) {
        const auto index = static_cast<std::uint8_t>(first + column);
#pragma omp simd
        for (std::int64_t c = 0; c < channels; ++c) row[c] += indices[c] == index ? pixel[c] : T(0);
    }
}

}  // namespace

MaxPooled max_pool2d(const Tensor& x, const Shape& output_shape, const MaxPoolOptions& options) {
    const std::int64_t height = x.shape(1);
    const std::int64_t width = x.shape(2);
    const std::int64_t channels = x.shape(3);
    const std::int64_t out_height = output_shape[1];
    const std::int64_t out_width = output_shape[2];
    MaxPooled result{Tensor(output_shape, x.dtype()),
                     WindowIndices(static_cast<std::size_t>(output_shape.size()))};
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = result.values.mutable_values<T>().data();
        for_each_row(output_shape, [&](std::int64_t out_row) {
            const std::int64_t row = out_row % out_height * options.stride;
            for (std::int64_t out_column = 0; out_column < out_width; ++out_column) {
                const std::int64_t column = out_column * options.stride;
                const std::int64_t to = (out_row * out_width + out_column) * channels;
                choose_largest(
                    in + ((out_row / out_height * height + row) * width + column) * channels,
                    clipped(row, height, options.kernel), clipped(column, width, options.kernel),
                    options.kernel, width * channels, channels, out + to,
                    result.indices.data() + to);
            }
        });
    });
    return result;
}

Tensor gather_windows(const Tensor& x, const WindowIndices& indices, const Shape& output_shape,
                      const MaxPoolOptions& options) {
    const std::int64_t height = x.shape(1);
    const std::int64_t width = x.shape(2);
    const std::int64_t channels = x.shape(3);
    const std::int64_t out_height = output_shape[1];
    const std::int64_t out_width = output_shape[2];
    std::array<std::int64_t, max_pool_kernel * max_pool_kernel> offsets{};
    for (std::int64_t index = 0; index < options.kernel * options.kernel; ++index)
        offsets[static_cast<std::size_t>(index)] =
            (index / options.kernel * width + index % options.kernel) * channels;
    Tensor y(output_shape, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        for_each_row(output_shape, [&](std::int64_t out_row) {
            const T* line =
                in + (out_row / out_height * height + out_row % out_height * options.stride) *
                         width * channels;
            for (std::int64_t out_column = 0; out_column < out_width; ++out_column) {
                const T* window = line + out_column * options.stride * channels;
                const std::int64_t to = (out_row * out_width + out_column) * channels;
                for (std::int64_t c = 0; c < channels; ++c)
                    out[to + c] = window[offsets[indices[static_cast<std::size_t>(to + c)]] + c];
            }
        });
    });
    return y;
}

Tensor scatter_windows(const Tensor& y, const WindowIndices& indices, const Shape& input_shape,
                       const MaxPoolOptions& options) {
    const std::int64_t height = input_shape[1];
    const std::int64_t width = input_shape[2];
    const std::int64_t channels = input_shape[3];
    const std::int64_t out_height = y.shape(1);
    const std::int64_t out_width = y.shape(2);
    Tensor x(input_shape, y.dtype());
    dispatch(y.dtype(), [&]<class T>(T) {
        const T* from = y.values<T>().data();
        T* to = x.mutable_values<T>().data();
        // Each input row collects from all windows that contain it, so that rows are independent
        // even if windows overlap.
        for_each_row(input_shape, [&](std::int64_t in_row) {
            std::fill_n(to + in_row * width * channels, width * channels, T(0));
            const std::int64_t row = in_row % height;
            const std::int64_t first =
                std::max<std::int64_t>(0, (row - options.kernel + options.stride) / options.stride);
            const std::int64_t last = std::min(out_height - 1, row / options.stride);
            for (std::int64_t out_row = first; out_row <= last; ++out_row) {
                const std::int64_t row_in_window = row - out_row * options.stride;
                const std::int64_t line =
                    (in_row / height * out_height + out_row) * out_width * channels;
                for (std::int64_t out_column = 0; out_column < out_width; ++out_column) {
                    add_to_row(from + line + out_column * channels,
                               indices.data() + line + out_column * channels, channels,
                               row_in_window * options.kernel,
                               clipped(out_column * options.stride, width, options.kernel),
                               to + (in_row * width + out_column * options.stride) * channels);
                }
            }
        });
    });
    return x;
}

}  // namespace stymo::kernels
