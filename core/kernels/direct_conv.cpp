#include <algorithm>
#include <memory>
#include <vector>

#include "core/kernels/conv_algorithms.h"
#include "core/kernels/gemm.h"
#include "core/parallel.h"

namespace stymo::kernels {

namespace {

/// Elements of unfolded pixels that stay in the second-level cache.
constexpr std::int64_t unfolded_size = 1 << 18;
/// Pixels for which reading the filters again is worthwhile.
constexpr std::int64_t enough_pixels = 256;
/// Largest number of input channels for which a transposed convolution scatters products instead of
/// gathering operands.
constexpr std::int64_t most_scattered_channels = 8;

/// One axis of a convolution: the target's pixel n = start + step * i takes taps t of the source's
/// pixels source_step * i + first + t.
struct Axis {
    std::int64_t source, target;  ///< lengths
    std::int64_t start, step, count;
    std::int64_t source_step, first, taps;
};

Axis forward_axis(std::int64_t in, std::int64_t out, std::int64_t kernel, const ConvGeometry& g) {
    return {in, out, 0, 1, out, g.stride, -g.padding, kernel};
}

/// The input's pixels `start`, start + stride, ..., which take every stride-th tap of the kernel,
/// the last of them first.
Axis transposed_axis(std::int64_t in, std::int64_t out, std::int64_t kernel, std::int64_t start,
                     const ConvGeometry& g) {
    const std::int64_t lowest = (start + g.padding) % g.stride;
    const std::int64_t taps = lowest < kernel ? chunk_count(kernel - lowest, g.stride) : 0;
    const std::int64_t count = start < in ? chunk_count(in - start, g.stride) : 0;
    return {out, in, start, g.stride, count, 1, (start + g.padding) / g.stride - (taps - 1), taps};
}

/// Channels of the two images and how they fall into groups.
struct Channels {
    std::int64_t source, target, groups;

    [[nodiscard]] std::int64_t group_source() const { return source / groups; }
    [[nodiscard]] std::int64_t group_target() const { return target / groups; }
};

/// A convolution seen from the image that it writes.
struct Gather {
    Axis rows, columns;
    Channels channels;

    [[nodiscard]] std::int64_t source_image() const {
        return rows.source * columns.source * channels.source;
    }
    [[nodiscard]] std::int64_t target_image() const {
        return rows.target * columns.target * channels.target;
    }
    [[nodiscard]] std::int64_t row_size() const { return columns.taps * channels.group_source(); }
    /// Rows of taps that are unfolded together: all if enough pixels fit that way, else fewer,
    /// whose products are added up.
    [[nodiscard]] std::int64_t slice() const {
        const std::int64_t most =
            unfolded_size / (enough_pixels * std::max<std::int64_t>(1, row_size()));
        return std::clamp<std::int64_t>(most, 1, std::max<std::int64_t>(1, rows.taps));
    }
    [[nodiscard]] std::int64_t slices() const { return chunk_count(rows.taps, slice()); }
    [[nodiscard]] std::int64_t slice_size(std::int64_t index) const {
        return std::min(slice(), rows.taps - index * slice()) * row_size();
    }
    /// Rows of target pixels that are handled at once.
    [[nodiscard]] std::int64_t band() const {
        const std::int64_t pixels = unfolded_size / std::max<std::int64_t>(1, slice() * row_size());
        return std::max<std::int64_t>(
            1, std::min<std::int64_t>(pixels, 1024) / std::max<std::int64_t>(1, columns.count));
    }
    [[nodiscard]] std::int64_t bands() const { return chunk_count(rows.count, band()); }
};

/// Copies the source pixels of one row of taps side by side, with zeros outside the image.
template <class T>
void unfold_pixel(const T* line, T* to, const Gather& g, std::int64_t group, std::int64_t column) {
    const std::int64_t begin = std::clamp<std::int64_t>(-column, 0, g.columns.taps);
    const std::int64_t end =
        std::clamp<std::int64_t>(g.columns.source - column, begin, g.columns.taps);
    const std::int64_t channels = g.channels.group_source();
    if (begin > 0) std::fill_n(to, begin * channels, T(0));
    if (g.channels.groups == 1) {
        std::copy_n(line + (column + begin) * channels, (end - begin) * channels,
                    to + begin * channels);
    } else {
        for (std::int64_t tap = begin; tap < end; ++tap)
            std::copy_n(line + (column + tap) * g.channels.source + group * channels, channels,
                        to + tap * channels);
    }
    if (end < g.columns.taps)
        std::fill_n(to + end * channels, (g.columns.taps - end) * channels, T(0));
}

/// Unfolds (im2col) the source pixels that one slice of taps reads for the target rows [first,
/// last) of one image: one matrix row for each target pixel.
template <class T>
void unfold(const T* image, T* columns, const Gather& g, std::int64_t group, std::int64_t slice,
            std::int64_t first, std::int64_t last) {
    const std::int64_t row_size = g.row_size();
    const std::int64_t slice_size = g.slice_size(slice);
    const std::int64_t taps = slice_size / std::max<std::int64_t>(1, row_size);
    for (std::int64_t i = first; i < last; ++i) {
        T* to = columns + (i - first) * g.columns.count * slice_size;
        for (std::int64_t tap = 0; tap < taps; ++tap, to += row_size) {
            const std::int64_t row =
                i * g.rows.source_step + g.rows.first + slice * g.slice() + tap;
            const bool inside = row >= 0 && row < g.rows.source;
            const T* line = image + row * g.columns.source * g.channels.source;
            for (std::int64_t j = 0; j < g.columns.count; ++j) {
                if (inside) {
                    unfold_pixel(line, to + j * slice_size, g, group,
                                 j * g.columns.source_step + g.columns.first);
                } else {
                    std::fill_n(to + j * slice_size, row_size, T(0));
                }
            }
        }
    }
}

template <class T>
using Buffer = std::unique_ptr<T[]>;

template <class T>
Buffer<T> uninitialised(std::int64_t size) {
    return std::make_unique_for_overwrite<T[]>(static_cast<std::size_t>(size));
}

template <class T>
void fill_zeros(T* target, const Gather& g, std::int64_t first, std::int64_t last) {
    for (std::int64_t i = first; i < last; ++i) {
        for (std::int64_t j = 0; j < g.columns.count; ++j) {
            const std::int64_t pixel = (g.rows.start + i * g.rows.step) * g.columns.target +
                                       g.columns.start + j * g.columns.step;
            std::fill_n(target + pixel * g.channels.target, g.channels.target, T(0));
        }
    }
}

/// Writes the target rows [first, last) of one image. Filters: one for each group and slice.
template <class T>
void convolve_band(const T* source, const std::vector<PackedMatrix<T>>& filters, T* columns,
                   T* target, const Gather& g, std::int64_t first, std::int64_t last) {
    if (g.rows.taps * g.columns.taps == 0) {
        fill_zeros(target, g, first, last);
        return;
    }
    const std::int64_t pixel_stride = g.columns.step * g.channels.target;
    // Rows of the target that follow each other without a gap are one matrix.
    const bool joined = g.rows.step == 1 && g.columns.step == 1;
    for (std::int64_t group = 0; group < g.channels.groups; ++group) {
        for (std::int64_t slice = 0; slice < g.slices(); ++slice) {
            unfold(source, columns, g, group, slice, first, last);
            const std::int64_t slice_size = g.slice_size(slice);
            const PackedMatrix<T>& right =
                filters[static_cast<std::size_t>(group * g.slices() + slice)];
            const std::int64_t pixels = (joined ? last - first : 1) * g.columns.count;
            for (std::int64_t i = first; i < last; i += joined ? last - first : 1) {
                const std::int64_t pixel =
                    (g.rows.start + i * g.rows.step) * g.columns.target + g.columns.start;
                multiply_packed<T>(
                    target + pixel * g.channels.target + group * g.channels.group_target(),
                    pixel_stride,
                    {columns + (i - first) * g.columns.count * slice_size, slice_size, 1}, pixels,
                    right, {.present_values = slice > 0});
            }
        }
    }
}

template <class T>
void convolve(const T* source, const std::vector<PackedMatrix<T>>& filters,
              const ConvFinish<T>& finish, T* target, std::int64_t batch, const Gather& g) {
    const std::int64_t bands = g.bands();
    // Bands that share a buffer; enough chunks for any number of threads.
    const std::int64_t run = chunk_count(batch * bands, 64);
    parallel_for(batch * bands, run, [&](std::int64_t begin, std::int64_t end) {
        const Buffer<T> columns = uninitialised<T>(
            g.band() * g.columns.count * std::max<std::int64_t>(1, g.slice() * g.row_size()));
        for (std::int64_t index = begin; index < end; ++index) {
            const std::int64_t first = index % bands * g.band();
            const std::int64_t last = std::min(g.rows.count, first + g.band());
            T* const image = target + index / bands * g.target_image();
            convolve_band(source + index / bands * g.source_image(), filters, columns.get(), image,
                          g, first, last);
            finish.apply(image + first * g.columns.target * g.channels.target,
                         (last - first) * g.columns.target, g.channels.target);
        }
    });
}

Gather forward(const ConvGeometry& g) {
    return {forward_axis(g.in_height, g.out_height, g.kernel_height, g),
            forward_axis(g.in_width, g.out_width, g.kernel_width, g),
            {g.in_channels, g.out_channels, g.groups}};
}

/// The filters as right operands, (taps and input channels, output channels), for each group and
/// slice.
template <class T>
std::vector<PackedMatrix<T>> pack_forward(const T* weight, const Gather& forward,
                                          const ConvGeometry& g) {
    std::vector<PackedMatrix<T>> filters(static_cast<std::size_t>(g.groups * forward.slices()));
    for (std::int64_t index = 0; index < g.groups * forward.slices(); ++index) {
        const std::int64_t slice = index % forward.slices();
        const T* first = weight + index / forward.slices() * g.group_out() * g.filter_size();
        filters[static_cast<std::size_t>(index)] =
            PackedMatrix<T>(first + slice * forward.slice() * forward.row_size(),
                            forward.slice_size(slice), g.group_out(), 1, g.filter_size());
    }
    return filters;
}

/// The same from output to input channels, with only the taps that one phase of the input's pixels
/// uses.
template <class T>
std::vector<PackedMatrix<T>> pack_transposed(const T* weight, const Gather& phase,
                                             const ConvGeometry& g) {
    // Maps a tap of the gather to a tap of the kernel.
    const auto tap_of = [&](const Axis& axis, std::int64_t tap) {
        return (axis.start + g.padding) % g.stride + (axis.taps - 1 - tap) * g.stride;
    };
    std::vector<PackedMatrix<T>> filters(static_cast<std::size_t>(g.groups * phase.slices()));
    parallel_for(g.groups * phase.slices(), 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t slice = index % phase.slices();
        const std::int64_t size = phase.slice_size(slice);
        const Buffer<T> matrix = uninitialised<T>(size * g.group_in());
        T* to = matrix.get();
        const T* first = weight + index / phase.slices() * g.group_out() * g.filter_size();
        for (std::int64_t i = 0; i < size / g.group_out(); ++i) {
            const std::int64_t row =
                tap_of(phase.rows, slice * phase.slice() + i / phase.columns.taps);
            const std::int64_t column = tap_of(phase.columns, i % phase.columns.taps);
            for (std::int64_t out = 0; out < g.group_out(); ++out, to += g.group_in())
                std::copy_n(
                    first + out * g.filter_size() + (row * g.kernel_width + column) * g.group_in(),
                    g.group_in(), to);
        }
        filters[static_cast<std::size_t>(index)] =
            PackedMatrix<T>(matrix.get(), size, g.group_in(), g.group_in(), 1);
    });
    return filters;
}

/// Adds the unfolded products of output row `out_row` to the input rows [first, last) of one image.
template <class T>
void fold_row(const T* columns, T* image, const ConvGeometry& g, std::int64_t out_row,
              std::int64_t first, std::int64_t last) {
    const std::int64_t row_size = g.kernel_width * g.in_channels;
    for (std::int64_t tap = 0; tap < g.kernel_height; ++tap) {
        const std::int64_t row = out_row * g.stride + tap - g.padding;
        if (row < first || row >= last) continue;
        for (std::int64_t out_column = 0; out_column < g.out_width; ++out_column) {
            const std::int64_t column = out_column * g.stride - g.padding;
            const std::int64_t begin =
                std::clamp<std::int64_t>(-column, 0, g.kernel_width) * g.in_channels;
            const std::int64_t end =
                std::clamp<std::int64_t>(g.in_width - column, 0, g.kernel_width) * g.in_channels;
            const T* from = columns + out_column * g.filter_size() + tap * row_size;
            T* to = image + (row * g.in_width + column) * g.in_channels;
            for (std::int64_t i = begin; i < end; ++i) to[i] += from[i];
        }
    }
}

/// The transposed convolution to few channels. All taps of an output pixel are columns of one
/// product; with a gather, most columns of a panel would be empty.
template <class T>
void scatter(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g) {
    const PackedMatrix<T> filters(weight, g.out_channels, g.filter_size(), g.filter_size(), 1);
    // Bands of input rows, each written by only one thread. Output rows at the border of two bands
    // are multiplied twice.
    const std::int64_t rows = std::max<std::int64_t>(
        g.stride * g.kernel_height,
        g.stride * (unfolded_size / std::max<std::int64_t>(1, g.out_width * g.filter_size())));
    const std::int64_t bands = chunk_count(g.in_height, rows);
    parallel_for(g.batch * bands, 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t first = index % bands * rows;
        const std::int64_t last = std::min(g.in_height, first + rows);
        T* const image = dL_dx + index / bands * g.input_image();
        std::fill_n(image + first * g.in_width * g.in_channels,
                    (last - first) * g.in_width * g.in_channels, T(0));
        const std::int64_t lowest =
            std::max<std::int64_t>(0, first + g.padding - g.kernel_height + 1);
        const std::int64_t begin = chunk_count(lowest, g.stride);
        const std::int64_t end = std::min(g.out_height, (last - 1 + g.padding) / g.stride + 1);
        if (begin >= end) return;
        const std::int64_t line = g.out_width * g.filter_size();
        const Buffer<T> columns = uninitialised<T>((end - begin) * line);
        const T* from =
            dL_dy + index / bands * g.output_image() + begin * g.out_width * g.out_channels;
        multiply_packed<T>(columns.get(), g.filter_size(), {from, g.out_channels, 1},
                           (end - begin) * g.out_width, filters);
        for (std::int64_t row = begin; row < end; ++row)
            fold_row(columns.get() + (row - begin) * line, image, g, row, first, last);
    });
}

}  // namespace

template <class T>
void direct_conv2d(const T* x, const T* weight, const ConvFinish<T>& finish, T* y,
                   const ConvGeometry& g) {
    const Gather gather = forward(g);
    convolve(x, pack_forward(weight, gather, g), finish, y, g.batch, gather);
}

template <class T>
void direct_conv2d_transpose(const T* dL_dy, const T* weight, T* dL_dx, const ConvGeometry& g) {
    if (g.groups == 1 && g.in_channels <= most_scattered_channels)
        return scatter(dL_dy, weight, dL_dx, g);
    for (std::int64_t phase = 0; phase < g.stride * g.stride; ++phase) {
        const Gather gather{
            transposed_axis(g.in_height, g.out_height, g.kernel_height, phase / g.stride, g),
            transposed_axis(g.in_width, g.out_width, g.kernel_width, phase % g.stride, g),
            {g.out_channels, g.in_channels, g.groups}};
        convolve(dL_dy, pack_transposed(weight, gather, g), ConvFinish<T>{}, dL_dx, g.batch,
                 gather);
    }
}

namespace {

/// Output channels of one piece of a weight gradient.
constexpr std::int64_t piece_channels = 128;

/// One piece of the weight's gradient: some output channels of one group, and one slice of taps.
struct WeightPiece {
    std::int64_t group, slice, first_out, outs;
};

WeightPiece weight_piece(std::int64_t index, const Gather& gather) {
    const std::int64_t blocks = chunk_count(gather.channels.group_target(), piece_channels);
    const std::int64_t first = index % blocks * piece_channels;
    return {index / blocks / gather.slices(), index / blocks % gather.slices(), first,
            std::min(piece_channels, gather.channels.group_target() - first)};
}

/// Adds the bands [begin, end) of all images to one piece of the weight's gradient, beginning anew
/// at `begin`.
template <class T>
void sum_bands(const T* dL_dy, const T* x, T* dL_dweight, const Gather& gather,
               const ConvGeometry& g, const WeightPiece& piece, std::int64_t begin,
               std::int64_t end) {
    const std::int64_t size = gather.slice_size(piece.slice);
    const Buffer<T> columns = uninitialised<T>(gather.band() * g.out_width * size);
    T* to = dL_dweight + (piece.group * g.group_out() + piece.first_out) * g.filter_size() +
            piece.slice * gather.slice() * gather.row_size();
    for (std::int64_t index = begin; index < end; ++index) {
        const std::int64_t first = index % gather.bands() * gather.band();
        const std::int64_t last = std::min(g.out_height, first + gather.band());
        unfold(x + index / gather.bands() * g.input_image(), columns.get(), gather, piece.group,
               piece.slice, first, last);
        const PackedMatrix<T> right(columns.get(), (last - first) * g.out_width, size, size, 1);
        const T* gradient = dL_dy + index / gather.bands() * g.output_image() +
                            first * g.out_width * g.out_channels + piece.group * g.group_out() +
                            piece.first_out;
        multiply_packed<T>(to, g.filter_size(), {gradient, 1, g.out_channels}, piece.outs, right,
                           {.present_values = index > begin});
    }
}

}  // namespace

template <class T>
void direct_conv2d_weight_grad(const T* dL_dy, const T* x, T* dL_dweight, const ConvGeometry& g) {
    const Gather gather = forward(g);
    const std::int64_t pieces =
        g.groups * gather.slices() * chunk_count(g.group_out(), piece_channels);
    const std::int64_t bands = g.batch * gather.bands();
    if (bands == 0) {
        std::fill_n(dL_dweight, g.out_channels * g.filter_size(), T(0));
        return;
    }
    // Few pieces: each of them in a few fixed runs of bands, which are added in order.
    const std::int64_t run = std::max<std::int64_t>(1, chunk_count(bands, pieces < 6 ? 8 : 1));
    const std::int64_t runs = std::max<std::int64_t>(1, chunk_count(bands, run));
    const std::int64_t size = g.out_channels * g.filter_size();
    const Buffer<T> partial = uninitialised<T>((runs - 1) * size);
    parallel_for(pieces * runs, 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t part = index / pieces;
        sum_bands(dL_dy, x, part == 0 ? dL_dweight : partial.get() + (part - 1) * size, gather, g,
                  weight_piece(index % pieces, gather), part * run,
                  std::min(bands, (part + 1) * run));
    });
    for (std::int64_t part = 1; part < runs; ++part) {
        for (std::int64_t i = 0; i < size; ++i)
            dL_dweight[i] += partial[static_cast<std::size_t>((part - 1) * size + i)];
    }
}

template void direct_conv2d(const float*, const float*, const ConvFinish<float>&, float*,
                            const ConvGeometry&);
template void direct_conv2d(const double*, const double*, const ConvFinish<double>&, double*,
                            const ConvGeometry&);
template void direct_conv2d_transpose(const float*, const float*, float*, const ConvGeometry&);
template void direct_conv2d_transpose(const double*, const double*, double*, const ConvGeometry&);
template void direct_conv2d_weight_grad(const float*, const float*, float*, const ConvGeometry&);
template void direct_conv2d_weight_grad(const double*, const double*, double*, const ConvGeometry&);

}  // namespace stymo::kernels
