#include "core/kernels/shape.h"

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

/// Calls body(row) for every row, in parallel. `row_size` is the number of elements in each.
template <class Body>
void for_each_row(std::int64_t rows, std::int64_t row_size, const Body& body) {
    const std::int64_t grain =
        std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, row_size));
    parallel_for(rows, grain, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t row = begin; row < end; ++row) body(row);
    });
}

}  // namespace

Tensor permute(const Tensor& x, const std::vector<int>& order) {
    const int rank = x.rank();
    std::array<std::int64_t, Shape::max_rank> stride_of_input{};
    std::array<std::int64_t, Shape::max_rank> stride{};
    Shape shape = x.shape();
    for (int axis = 0; axis < rank; ++axis)
        stride_of_input[static_cast<std::size_t>(axis)] = x.shape().product(axis + 1, rank);
    for (int axis = 0; axis < rank; ++axis) {
        const int from = order[static_cast<std::size_t>(axis)];
        shape = shape.with(axis, x.shape(from));
        stride[static_cast<std::size_t>(axis)] = stride_of_input[static_cast<std::size_t>(from)];
    }
    Tensor y(shape, x.dtype());
    if (rank == 0) return x;
    if (shape.size() == 0) return y;
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const std::int64_t length = shape[rank - 1];
        const std::int64_t step = stride[static_cast<std::size_t>(rank - 1)];
        for_each_row(shape.size() / length, length, [&](std::int64_t row) {
            const T* from = in;
            std::int64_t rest = row;
            for (int axis = rank - 2; axis >= 0; --axis) {
                from += rest % shape[axis] * stride[static_cast<std::size_t>(axis)];
                rest /= shape[axis];
            }
            T* to = out + row * length;
            if (step == 1) {
                std::copy_n(from, length, to);
            } else {
                for (std::int64_t i = 0; i < length; ++i) to[i] = from[i * step];
            }
        });
    });
    return y;
}

Tensor flip(const Tensor& x, int axis) {
    const std::int64_t middle = x.shape(axis);
    const std::int64_t inner = x.shape().product(axis + 1, x.rank());
    Tensor y(x.shape(), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        for_each_row(inner == 0 ? 0 : x.size() / inner, inner, [=](std::int64_t row) {
            const std::int64_t mirrored = row / middle * middle + (middle - 1 - row % middle);
            std::copy_n(in + mirrored * inner, inner, out + row * inner);
        });
    });
    return y;
}

Tensor slice(const Tensor& x, int axis, std::int64_t begin, std::int64_t end) {
    const std::int64_t inner = x.shape().product(axis + 1, x.rank());
    const std::int64_t from_row = x.shape(axis) * inner;
    const std::int64_t length = (end - begin) * inner;
    Tensor y(x.shape().with(axis, end - begin), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data() + begin * inner;
        T* out = y.mutable_values<T>().data();
        for_each_row(x.shape().product(0, axis), length, [=](std::int64_t row) {
            std::copy_n(in + row * from_row, length, out + row * length);
        });
    });
    return y;
}

Tensor concat(const std::vector<Tensor>& parts, int axis) {
    const Tensor& first = parts.front();
    std::int64_t extent = 0;
    for (const Tensor& part : parts) {
        if (part.dtype() != first.dtype())
            fail<TypeError>("[concat] parts are ", first.dtype(), " and ", part.dtype());
        if (part.rank() != first.rank() ||
            part.shape().with(axis, 1) != first.shape().with(axis, 1)) {
            fail<ShapeError>("[concat] shapes ", first.shape(), " and ", part.shape(),
                             " differ beside axis ", axis);
        }
        extent += part.shape(axis);
    }
    Tensor y(first.shape().with(axis, extent), first.dtype());
    const std::int64_t inner = first.shape().product(axis + 1, first.rank());
    dispatch(first.dtype(), [&]<class T>(T) {
        T* out = y.mutable_values<T>().data();
        const std::int64_t stride = extent * inner;
        for (const Tensor& part : parts) {
            const T* in = part.values<T>().data();
            const std::int64_t length = part.shape(axis) * inner;
            for_each_row(first.shape().product(0, axis), length, [=](std::int64_t row) {
                std::copy_n(in + row * length, length, out + row * stride);
            });
            out += length;
        }
    });
    return y;
}

namespace {

/// Walks every (small pixel, sub-pixel) pair: calls move(index in (h, w, 4c) order with step 4,
/// index in (2h, 2w, c) order, channels).
template <class Move>
void for_each_subpixel(std::int64_t batch, std::int64_t height, std::int64_t width,
                       std::int64_t channels, Move move) {
    for_each_row(batch * height, width * channels * 4, [=](std::int64_t row) {
        for (std::int64_t i = 0; i < width * 4; ++i) {
            const std::int64_t column = i / 4, k = i % 4;
            const std::int64_t packed = (row * width + column) * channels * 4 + k;
            const std::int64_t spread =
                ((row * 2 + k / 2) * width * 2 + column * 2 + k % 2) * channels;
            move(packed, spread);
        }
    });
}

}  // namespace

Tensor pixel_shuffle(const Tensor& x, const Tensor& coarse) {
    const std::int64_t channels = x.shape(3) / 4;
    Tensor y({x.shape(0), x.shape(1) * 2, x.shape(2) * 2, channels}, x.dtype());
    if (y.size() == 0) return y;
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        const T* added = coarse.defined() ? coarse.values<T>().data() : nullptr;
        T* out = y.mutable_values<T>().data();
        const auto copy = [=](std::int64_t packed, std::int64_t spread) {
            for (std::int64_t c = 0; c < channels; ++c) out[spread + c] = in[packed + 4 * c];
        };
        const auto add = [=](std::int64_t packed, std::int64_t spread) {
            const T* const from = added + packed / (4 * channels) * channels;
            for (std::int64_t c = 0; c < channels; ++c)
                out[spread + c] = in[packed + 4 * c] + from[c];
        };
        const auto walk = [&](const auto& move) {
            for_each_subpixel(x.shape(0), x.shape(1), x.shape(2), channels, move);
        };
        if (added == nullptr)
            walk(copy);
        else
            walk(add);
    });
    return y;
}

Tensor pixel_unshuffle(const Tensor& x) {
    const std::int64_t channels = x.shape(3);
    Tensor y({x.shape(0), x.shape(1) / 2, x.shape(2) / 2, channels * 4}, x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        for_each_subpixel(y.shape(0), y.shape(1), y.shape(2), channels,
                          [=](std::int64_t packed, std::int64_t spread) {
                              for (std::int64_t c = 0; c < channels; ++c)
                                  out[packed + 4 * c] = in[spread + c];
                          });
    });
    return y;
}

Tensor gather_rows(const Tensor& x, const RowIndices& rows) {
    const std::int64_t width = x.shape().product(1, x.rank());
    Tensor y(x.shape().with(0, static_cast<std::int64_t>(rows.size())), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        for_each_row(std::ssize(rows), width, [&](std::int64_t i) {
            std::copy_n(in + rows[static_cast<std::size_t>(i)] * width, width, out + i * width);
        });
    });
    return y;
}

Tensor scatter_add_rows(const Tensor& x, const RowIndices& rows, std::int64_t row_count) {
    const std::int64_t width = x.shape().product(1, x.rank());
    Tensor y = Tensor::zeros(x.shape().with(0, row_count), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        // Several rows may have the same index, so they are added one after the other.
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const T* from = in + static_cast<std::int64_t>(i) * width;
            T* to = out + rows[i] * width;
            for (std::int64_t c = 0; c < width; ++c) to[c] += from[c];
        }
    });
    return y;
}

}  // namespace stymo::kernels
