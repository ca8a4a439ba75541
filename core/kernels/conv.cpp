#include "core/kernels/conv.h"

#include <algorithm>
#include <vector>

#include "core/kernels/map.h"
#include "core/kernels/matmul.h"

namespace stymo::kernels {

namespace {

struct Geometry {
    std::int64_t batch, in_height, in_width, in_channels;
    std::int64_t out_height, out_width, out_channels;
    std::int64_t kernel_height, kernel_width;
    std::int64_t stride, padding, groups;

    [[nodiscard]] std::int64_t group_in() const { return in_channels / groups; }
    [[nodiscard]] std::int64_t group_out() const { return out_channels / groups; }
    [[nodiscard]] std::int64_t column_size() const { return kernel_height * kernel_width * group_in(); }
    /// Output rows of one tile: about a thousand pixels, so that their unfolded columns stay in cache.
    [[nodiscard]] std::int64_t band() const { return std::max<std::int64_t>(1, 1024 / std::max<std::int64_t>(1, out_width)); }
    [[nodiscard]] bool depthwise() const { return groups > 1 && group_in() == 1 && group_out() == 1; }
};

Geometry geometry(const Shape& x, const Shape& weight, const Shape& y, const Conv2dOptions& options) {
    return {x[0], x[1], x[2], x[3], y[1], y[2], y[3], weight[1], weight[2], options.stride, options.padding, options.groups};
}

/// Calls visit(kernel place, input row) for every kernel row that reaches the image at this output row; the same below for
/// columns.
template <class Visit>
void for_each_kernel_row(const Geometry& g, std::int64_t out_row, Visit visit) {
    for (std::int64_t k = 0; k < g.kernel_height; ++k) {
        const std::int64_t row = out_row * g.stride + k - g.padding;
        if (row >= 0 && row < g.in_height) visit(k, row);
    }
}

template <class Visit>
void for_each_kernel_column(const Geometry& g, std::int64_t out_column, Visit visit) {
    for (std::int64_t k = 0; k < g.kernel_width; ++k) {
        const std::int64_t column = out_column * g.stride + k - g.padding;
        if (column >= 0 && column < g.in_width) visit(k, column);
    }
}

/// Unfolds the receptive fields of output rows [first, last) of one image and group: one matrix row for each output pixel.
template <class T>
void unfold(const T* image, T* columns, const Geometry& g, std::int64_t group, std::int64_t first, std::int64_t last) {
    std::fill_n(columns, (last - first) * g.out_width * g.column_size(), T(0));
    for (std::int64_t out_row = first; out_row < last; ++out_row) {
        for_each_kernel_row(g, out_row, [&](std::int64_t kernel_row, std::int64_t row) {
            for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
                T* pixel = columns + ((out_row - first) * g.out_width + out_column) * g.column_size();
                for_each_kernel_column(g, out_column, [&](std::int64_t kernel_column, std::int64_t column) {
                    const T* from = image + (row * g.in_width + column) * g.in_channels + group * g.group_in();
                    std::copy_n(from, g.group_in(), pixel + (kernel_row * g.kernel_width + kernel_column) * g.group_in());
                });
            }
        });
    }
}

/// Copies one group's channels of output rows between an image and a contiguous matrix.
template <class T>
void gather_group(const T* image, T* matrix, const Geometry& g, std::int64_t group, std::int64_t pixels) {
    for (std::int64_t i = 0; i < pixels; ++i)
        std::copy_n(image + i * g.out_channels + group * g.group_out(), g.group_out(), matrix + i * g.group_out());
}

template <class T>
void scatter_group(const T* matrix, T* image, const Geometry& g, std::int64_t group, std::int64_t pixels) {
    for (std::int64_t i = 0; i < pixels; ++i)
        std::copy_n(matrix + i * g.group_out(), g.group_out(), image + i * g.out_channels + group * g.group_out());
}

template <class T>
void convolve_band(const T* image, const T* weight, T* y, const Geometry& g, std::int64_t first, std::int64_t last) {
    const std::int64_t pixels = (last - first) * g.out_width;
    std::vector<T> columns(static_cast<std::size_t>(pixels * g.column_size()));
    std::vector<T> product(g.groups == 1 ? 0 : static_cast<std::size_t>(pixels * g.group_out()));
    for (std::int64_t group = 0; group < g.groups; ++group) {
        unfold(image, columns.data(), g, group, first, last);
        T* target = g.groups == 1 ? y : product.data();
        multiply_into(target, columns.data(), weight + group * g.group_out() * g.column_size(), pixels, g.group_out(),
                      g.column_size(), {.transpose_b = true}, false);
        if (g.groups > 1) scatter_group(product.data(), y, g, group, pixels);
    }
}

/// One channel in, one channel out: the loop over channels is innermost and contiguous.
template <class T>
void convolve_depthwise(const T* image, const T* weight_by_place, T* y, const Geometry& g, std::int64_t first,
                        std::int64_t last) {
    std::fill_n(y, (last - first) * g.out_width * g.out_channels, T(0));
    for (std::int64_t out_row = first; out_row < last; ++out_row) {
        for_each_kernel_row(g, out_row, [&](std::int64_t kernel_row, std::int64_t row) {
            for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
                T* to = y + ((out_row - first) * g.out_width + out_column) * g.out_channels;
                for_each_kernel_column(g, out_column, [&](std::int64_t kernel_column, std::int64_t column) {
                    const T* from = image + (row * g.in_width + column) * g.in_channels;
                    const T* w = weight_by_place + (kernel_row * g.kernel_width + kernel_column) * g.in_channels;
                    for (std::int64_t c = 0; c < g.in_channels; ++c) to[c] += w[c] * from[c];
                });
            }
        });
    }
}

/// Depthwise weights (channels, places) turned to (places, channels).
template <class T>
std::vector<T> by_place(const T* weight, const Geometry& g) {
    const std::int64_t places = g.kernel_height * g.kernel_width;
    std::vector<T> result(static_cast<std::size_t>(places * g.in_channels));
    for (std::int64_t c = 0; c < g.in_channels; ++c) {
        for (std::int64_t place = 0; place < places; ++place)
            result[static_cast<std::size_t>(place * g.in_channels + c)] = weight[c * places + place];
    }
    return result;
}

}  // namespace

Tensor conv2d(const Tensor& x, const Tensor& weight, const Shape& output_shape, const Conv2dOptions& options) {
    const Geometry g = geometry(x.shape(), weight.shape(), output_shape, options);
    Tensor y(output_shape, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        const T* w = weight.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const std::vector<T> places = g.depthwise() ? by_place(w, g) : std::vector<T>{};
        const std::int64_t bands = chunk_count(g.out_height, g.band());
        parallel_for(g.batch * bands, 1, [&](std::int64_t index, std::int64_t) {
            const std::int64_t sample = index / bands;
            const std::int64_t first = index % bands * g.band();
            const std::int64_t last = std::min(g.out_height, first + g.band());
            const T* image = in + sample * g.in_height * g.in_width * g.in_channels;
            T* to = out + (sample * g.out_height + first) * g.out_width * g.out_channels;
            if (g.depthwise()) {
                convolve_depthwise(image, places.data(), to, g, first, last);
            } else {
                convolve_band(image, w, to, g, first, last);
            }
        });
    });
    return y;
}

namespace {

/// Output rows whose receptive field touches input rows [first, last).
struct RowRange {
    std::int64_t first, last;
};

RowRange output_rows_touching(const Geometry& g, std::int64_t first, std::int64_t last) {
    const std::int64_t low = first + g.padding - g.kernel_height + 1;
    return {low <= 0 ? 0 : (low + g.stride - 1) / g.stride, std::min(g.out_height, (last - 1 + g.padding) / g.stride + 1)};
}

/// Adds one output row's unfolded gradient back to the input rows within [first, last).
template <class T>
void fold_row(const T* columns, T* image, const Geometry& g, std::int64_t group, std::int64_t out_row, std::int64_t first,
              std::int64_t last) {
    for_each_kernel_row(g, out_row, [&](std::int64_t kernel_row, std::int64_t row) {
        if (row < first || row >= last) return;
        for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
            const T* pixel = columns + out_column * g.column_size();
            for_each_kernel_column(g, out_column, [&](std::int64_t kernel_column, std::int64_t column) {
                T* to = image + (row * g.in_width + column) * g.in_channels + group * g.group_in();
                const T* from = pixel + (kernel_row * g.kernel_width + kernel_column) * g.group_in();
                for (std::int64_t c = 0; c < g.group_in(); ++c) to[c] += from[c];
            });
        }
    });
}

template <class T>
void transpose_band(const T* dL_dy, const T* weight, T* dL_dx, const Geometry& g, std::int64_t first, std::int64_t last) {
    const RowRange rows = output_rows_touching(g, first, last);
    if (rows.first >= rows.last) return;
    const std::int64_t pixels = (rows.last - rows.first) * g.out_width;
    const T* gradient = dL_dy + rows.first * g.out_width * g.out_channels;
    std::vector<T> columns(static_cast<std::size_t>(pixels * g.column_size()));
    std::vector<T> gathered(g.groups == 1 ? 0 : static_cast<std::size_t>(pixels * g.group_out()));
    for (std::int64_t group = 0; group < g.groups; ++group) {
        if (g.groups > 1) gather_group(gradient, gathered.data(), g, group, pixels);
        multiply_into(columns.data(), g.groups == 1 ? gradient : gathered.data(),
                      weight + group * g.group_out() * g.column_size(), pixels, g.column_size(), g.group_out(), {}, false);
        for (std::int64_t row = rows.first; row < rows.last; ++row) {
            fold_row(columns.data() + (row - rows.first) * g.out_width * g.column_size(), dL_dx, g, group, row, first, last);
        }
    }
}

template <class T>
void transpose_depthwise(const T* dL_dy, const T* weight_by_place, T* dL_dx, const Geometry& g, std::int64_t first,
                         std::int64_t last) {
    const RowRange rows = output_rows_touching(g, first, last);
    for (std::int64_t out_row = rows.first; out_row < rows.last; ++out_row) {
        for_each_kernel_row(g, out_row, [&](std::int64_t kernel_row, std::int64_t row) {
            if (row < first || row >= last) return;
            for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
                const T* from = dL_dy + (out_row * g.out_width + out_column) * g.out_channels;
                for_each_kernel_column(g, out_column, [&](std::int64_t kernel_column, std::int64_t column) {
                    T* to = dL_dx + (row * g.in_width + column) * g.in_channels;
                    const T* w = weight_by_place + (kernel_row * g.kernel_width + kernel_column) * g.in_channels;
                    for (std::int64_t c = 0; c < g.in_channels; ++c) to[c] += w[c] * from[c];
                });
            }
        });
    }
}

}  // namespace

Tensor conv2d_transpose(const Tensor& dL_dy, const Tensor& weight, const Shape& input_shape, const Conv2dOptions& options) {
    const Geometry g = geometry(input_shape, weight.shape(), dL_dy.shape(), options);
    Tensor dL_dx = Tensor::zeros(input_shape, dL_dy.dtype());
    dispatch(dL_dy.dtype(), [&]<class T>(T) {
        const T* gradient = dL_dy.values<T>().data();
        const T* w = weight.values<T>().data();
        T* out = dL_dx.mutable_values<T>().data();
        const std::vector<T> places = g.depthwise() ? by_place(w, g) : std::vector<T>{};
        // Bands of input rows: each is written by one thread only; output rows at a seam are unfolded twice.
        const std::int64_t band = g.band() * g.stride;
        const std::int64_t bands = chunk_count(g.in_height, band);
        parallel_for(g.batch * bands, 1, [&](std::int64_t index, std::int64_t) {
            const std::int64_t sample = index / bands;
            const std::int64_t first = index % bands * band;
            const std::int64_t last = std::min(g.in_height, first + band);
            const T* from = gradient + sample * g.out_height * g.out_width * g.out_channels;
            T* image = out + sample * g.in_height * g.in_width * g.in_channels;
            if (g.depthwise()) {
                transpose_depthwise(from, places.data(), image, g, first, last);
            } else {
                transpose_band(from, w, image, g, first, last);
            }
        });
    });
    return dL_dx;
}

namespace {

/// Adds the weight gradient of output rows [first, last) of one image.
template <class T>
void weight_grad_band(const T* dL_dy, const T* image, T* dL_dweight, const Geometry& g, std::int64_t first, std::int64_t last) {
    const std::int64_t pixels = (last - first) * g.out_width;
    const T* gradient = dL_dy + first * g.out_width * g.out_channels;
    std::vector<T> columns(static_cast<std::size_t>(pixels * g.column_size()));
    std::vector<T> gathered(g.groups == 1 ? 0 : static_cast<std::size_t>(pixels * g.group_out()));
    for (std::int64_t group = 0; group < g.groups; ++group) {
        unfold(image, columns.data(), g, group, first, last);
        if (g.groups > 1) gather_group(gradient, gathered.data(), g, group, pixels);
        multiply_into(dL_dweight + group * g.group_out() * g.column_size(), g.groups == 1 ? gradient : gathered.data(),
                      columns.data(), g.group_out(), g.column_size(), pixels, {.transpose_a = true}, true);
    }
}

/// The depthwise case, accumulated as (places, channels) and turned at the end by the caller.
template <class T>
void weight_grad_depthwise(const T* dL_dy, const T* image, T* by_place_sum, const Geometry& g, std::int64_t first,
                           std::int64_t last) {
    for (std::int64_t out_row = first; out_row < last; ++out_row) {
        for_each_kernel_row(g, out_row, [&](std::int64_t kernel_row, std::int64_t row) {
            for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
                const T* gradient = dL_dy + (out_row * g.out_width + out_column) * g.out_channels;
                for_each_kernel_column(g, out_column, [&](std::int64_t kernel_column, std::int64_t column) {
                    const T* from = image + (row * g.in_width + column) * g.in_channels;
                    T* to = by_place_sum + (kernel_row * g.kernel_width + kernel_column) * g.in_channels;
                    for (std::int64_t c = 0; c < g.in_channels; ++c) to[c] += gradient[c] * from[c];
                });
            }
        });
    }
}

}  // namespace

Tensor conv2d_weight_grad(const Tensor& dL_dy, const Tensor& x, const Shape& weight_shape, const Conv2dOptions& options) {
    const Geometry g = geometry(x.shape(), weight_shape, dL_dy.shape(), options);
    Tensor dL_dweight(weight_shape, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* gradient = dL_dy.values<T>().data();
        const T* in = x.values<T>().data();
        // A few fixed runs of bands, each with its own sum: their number bounds the memory and does not depend on the threads.
        constexpr std::int64_t runs = 8;
        const std::int64_t bands = chunk_count(g.out_height, g.band());
        const std::int64_t run = std::max<std::int64_t>(1, chunk_count(g.batch * bands, runs));
        const std::int64_t used = chunk_count(g.batch * bands, run);
        const std::int64_t size = weight_shape.size();
        std::vector<T> partial(static_cast<std::size_t>(used * size), T(0));
        parallel_for(g.batch * bands, run, [&](std::int64_t begin, std::int64_t end) {
            T* sum = partial.data() + begin / run * size;
            for (std::int64_t index = begin; index < end; ++index) {
                const std::int64_t first = index % bands * g.band();
                const std::int64_t last = std::min(g.out_height, first + g.band());
                const T* from = gradient + index / bands * g.out_height * g.out_width * g.out_channels;
                const T* image = in + index / bands * g.in_height * g.in_width * g.in_channels;
                if (g.depthwise()) {
                    weight_grad_depthwise(from, image, sum, g, first, last);
                } else {
                    weight_grad_band(from, image, sum, g, first, last);
                }
            }
        });
        const std::int64_t places = g.kernel_height * g.kernel_width;
        const auto out = dL_dweight.mutable_values<T>();
        for (std::int64_t i = 0; i < size; ++i) {
            // A depthwise sum is (places, channels), the weight (channels, places).
            const std::int64_t source = g.depthwise() ? i % places * g.in_channels + i / places : i;
            T total = T(0);
            for (std::int64_t part = 0; part < used; ++part) total += partial[static_cast<std::size_t>(part * size + source)];
            out[static_cast<std::size_t>(i)] = total;
        }
    });
    return dL_dweight;
}

}  // namespace stymo::kernels
