#include "core/kernels/matmul.h"

#include <algorithm>
#include <vector>

#include "core/kernels/gemm.h"
#include "core/kernels/map.h"

namespace stymo::kernels {

namespace {

/// Rows of one tile: a multiple of the rows of every kernel's blocks, few enough that the tile
/// stays in the second-level cache.
constexpr std::int64_t tile_rows = 240;
/// Columns of one tile if all rows fit into one tile.
constexpr std::int64_t tile_columns = 128;
/// Length of one piece of a long inner sum; the pieces are added in order.
constexpr std::int64_t inner_piece = 8192;
/// Inner length that is packed at once for a single use, at most half of a second-level cache.
constexpr std::int64_t packed_inner = 512;
constexpr std::int64_t packed_columns = 512;
/// Results with at most this number of rows or columns are computed as inner products.
constexpr std::int64_t few = 4;
/// Largest number of rows for which the right operand is not packed: packing is only worthwhile if
/// it is read several times.
constexpr std::int64_t rows_in_place = 12;
/// Smallest number of multiply-adds for one thread.
constexpr std::int64_t product_grain = 32768;

struct Extents {
    std::int64_t batch, m, n, k;
};

template <class T>
LeftMatrix<T> left_matrix(const T* a, std::int64_t m, std::int64_t k, MatmulOptions options) {
    return options.transpose_a ? LeftMatrix<T>{a, 1, m} : LeftMatrix<T>{a, k, 1};
}

template <class T>
struct RightMatrix {
    const T* data;
    std::int64_t inner_stride;
    std::int64_t column_stride;

    /// The number of leading columns that a single product of m rows reads without packing.
    [[nodiscard]] std::int64_t columns_in_place(std::int64_t m, std::int64_t n) const {
        const std::int64_t width = PackedMatrix<T>::in_place(nullptr, 0, 0, 0).panel_width();
        return m <= rows_in_place && column_stride == 1 ? n / width * width : 0;
    }

    [[nodiscard]] PackedMatrix<T> pack(std::int64_t first_inner, std::int64_t k,
                                       std::int64_t first_column, std::int64_t n) const {
        return PackedMatrix<T>(data + first_inner * inner_stride + first_column * column_stride, k,
                               n, inner_stride, column_stride);
    }
};

template <class T>
RightMatrix<T> right_matrix(const T* b, std::int64_t n, std::int64_t k, MatmulOptions options) {
    return options.transpose_b ? RightMatrix<T>{b, 1, k} : RightMatrix<T>{b, n, 1};
}

/// Columns [first, last) of c = or += left * right, packed for this product only.
template <class T>
void multiply_once(T* c, std::int64_t stride, const LeftMatrix<T>& left, std::int64_t m,
                   const RightMatrix<T>& right, std::int64_t k, std::int64_t first,
                   std::int64_t last, bool accumulate) {
    const std::int64_t in_place = right.columns_in_place(m, last - first);
    if (in_place > 0) {
        multiply_packed<T>(
            c + first, stride, left, m,
            PackedMatrix<T>::in_place(right.data + first, k, in_place, right.inner_stride),
            {.present_values = accumulate});
    }
    for (std::int64_t column = first + in_place; column < last; column += packed_columns) {
        const std::int64_t columns = std::min(packed_columns, last - column);
        // At least once, so that an empty sum gives zeros.
        std::int64_t inner = 0;
        do {
            const std::int64_t length = std::min(packed_inner, k - inner);
            const LeftMatrix<T> part{left.data + inner * left.inner_stride, left.row_stride,
                                     left.inner_stride};
            multiply_packed<T>(c + column, stride, part, m,
                               right.pack(inner, length, column, columns),
                               {.present_values = accumulate || inner > 0});
            inner += length;
        } while (inner < k);
    }
}

/// Few result elements and a long inner sum (weight gradients): pieces of the sum in parallel,
/// added in a fixed order.
template <class T>
void multiply_long_inner(const LeftMatrix<T>& left, const RightMatrix<T>& right, T* c,
                         const Extents& e) {
    const std::int64_t pieces = chunk_count(e.k, inner_piece);
    std::vector<T> partial(static_cast<std::size_t>(pieces * e.m * e.n));
    parallel_for(pieces, 1, [&](std::int64_t piece, std::int64_t) {
        const std::int64_t first = piece * inner_piece;
        const LeftMatrix<T> left_piece{left.data + first * left.inner_stride, left.row_stride,
                                       left.inner_stride};
        const RightMatrix<T> right_piece{right.data + first * right.inner_stride,
                                         right.inner_stride, right.column_stride};
        multiply_once(partial.data() + piece * e.m * e.n, e.n, left_piece, e.m, right_piece,
                      std::min(inner_piece, e.k - first), 0, e.n, false);
    });
    for (std::int64_t i = 0; i < e.m * e.n; ++i) {
        T total = T(0);
        for (std::int64_t piece = 0; piece < pieces; ++piece)
            total += partial[static_cast<std::size_t>(piece * e.m * e.n + i)];
        c[i] = total;
    }
}

/// Packs `count` right operands, `stride` elements apart.
template <class T>
std::vector<PackedMatrix<T>> pack_all(RightMatrix<T> right, std::int64_t count, std::int64_t stride,
                                      std::int64_t k, std::int64_t n) {
    std::vector<PackedMatrix<T>> packed;
    for (std::int64_t i = 0; i < count; ++i, right.data += stride)
        packed.push_back(right.pack(0, k, 0, n));
    return packed;
}

/// Many rows: the right operands are packed once, and tiles of rows share them.
template <class T>
void multiply_row_tiles(const T* a, const T* b, T* c, const Extents& e, std::int64_t stride_a,
                        std::int64_t stride_b, MatmulOptions options) {
    const std::vector<PackedMatrix<T>> packed = pack_all(
        right_matrix(b, e.n, e.k, options), stride_b == 0 ? 1 : e.batch, stride_b, e.k, e.n);
    const std::int64_t tiles = chunk_count(e.m, tile_rows);
    parallel_for(e.batch * tiles, 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t batch = index / tiles;
        const std::int64_t first = index % tiles * tile_rows;
        LeftMatrix<T> left = left_matrix(a + batch * stride_a, e.m, e.k, options);
        left.data += first * left.row_stride;
        multiply_packed<T>(c + (batch * e.m + first) * e.n, e.n, left,
                           std::min(tile_rows, e.m - first),
                           packed[static_cast<std::size_t>(stride_b == 0 ? 0 : batch)]);
    });
}

/// Few rows: tiles of columns, each of which packs its own.
template <class T>
void multiply_column_tiles(const T* a, const T* b, T* c, const Extents& e, std::int64_t stride_a,
                           std::int64_t stride_b, MatmulOptions options) {
    const std::int64_t tiles = std::max<std::int64_t>(1, chunk_count(e.n, tile_columns));
    const std::int64_t work = e.m * std::min(e.n, tile_columns) * e.k;
    parallel_for(e.batch * tiles,
                 std::max<std::int64_t>(1, product_grain / std::max<std::int64_t>(1, work)),
                 [&](std::int64_t begin, std::int64_t end) {
                     for (std::int64_t index = begin; index < end; ++index) {
                         const std::int64_t batch = index / tiles;
                         const std::int64_t first = index % tiles * tile_columns;
                         multiply_once(c + batch * e.m * e.n, e.n,
                                       left_matrix(a + batch * stride_a, e.m, e.k, options), e.m,
                                       right_matrix(b + batch * stride_b, e.n, e.k, options), e.k,
                                       first, std::min(first + tile_columns, e.n), false);
                     }
                 });
}

/// A few inner products for each of many vectors, on several threads.
template <class T>
void multiply_dot_tiles(const Dots<T>& dots) {
    const std::int64_t grain =
        std::max<std::int64_t>(1, product_grain / std::max<std::int64_t>(1, dots.k * dots.count_y));
    parallel_for(dots.count_x, grain, [&](std::int64_t begin, std::int64_t end) {
        Dots<T> part = dots;
        part.x += begin * dots.k;
        part.count_x = end - begin;
        part.c += begin * dots.stride_x;
        multiply_dots(part);
    });
}

/// c = left * right^T with few rows on one side, both contiguous.
template <class T>
void multiply_few(const T* left, const T* right, T* c, const Extents& e) {
    if (e.n <= few) {
        multiply_dot_tiles<T>({left, e.m, right, e.n, e.k, c, e.n, 1});
    } else {
        multiply_dot_tiles<T>({right, e.n, left, e.m, e.k, c, 1, e.n});
    }
}

}  // namespace

template <class T>
void multiply_into(T* c, const T* a, const T* b, std::int64_t m, std::int64_t n, std::int64_t k,
                   MatmulOptions options, bool accumulate) {
    multiply_once(c, n, left_matrix(a, m, k, options), m, right_matrix(b, n, k, options), k, 0, n,
                  accumulate);
}

template void multiply_into<float>(float*, const float*, const float*, std::int64_t, std::int64_t,
                                   std::int64_t, MatmulOptions, bool);
template void multiply_into<double>(double*, const double*, const double*, std::int64_t,
                                    std::int64_t, std::int64_t, MatmulOptions, bool);

Tensor matmul(const Tensor& a, const Tensor& b, MatmulOptions options) {
    const Extents e{a.shape(0) == 1 ? b.shape(0) : a.shape(0), a.shape(options.transpose_a ? 2 : 1),
                    b.shape(options.transpose_b ? 1 : 2), a.shape(options.transpose_a ? 1 : 2)};
    Tensor c({e.batch, e.m, e.n}, a.dtype());
    dispatch(a.dtype(), [&]<class T>(T) {
        const T* in_a = a.values<T>().data();
        const T* in_b = b.values<T>().data();
        T* out = c.mutable_values<T>().data();
        const std::int64_t stride_a = a.shape(0) == 1 ? 0 : e.m * e.k;
        const std::int64_t stride_b = b.shape(0) == 1 ? 0 : e.n * e.k;
        if (options.transpose_a && !options.transpose_b && e.k >= 2 * inner_piece) {
            for (std::int64_t batch = 0; batch < e.batch; ++batch)
                multiply_long_inner(left_matrix(in_a + batch * stride_a, e.m, e.k, options),
                                    right_matrix(in_b + batch * stride_b, e.n, e.k, options),
                                    out + batch * e.m * e.n, e);
        } else if (options.transpose_b && !options.transpose_a && std::min(e.m, e.n) <= few) {
            for (std::int64_t batch = 0; batch < e.batch; ++batch)
                multiply_few(in_a + batch * stride_a, in_b + batch * stride_b,
                             out + batch * e.m * e.n, e);
        } else if (e.m > tile_rows) {
            multiply_row_tiles(in_a, in_b, out, e, stride_a, stride_b, options);
        } else {
            multiply_column_tiles(in_a, in_b, out, e, stride_a, stride_b, options);
        }
    });
    return c;
}

namespace {

/// x (batch, m, k), weights (batch, n, k), results and slopes (null: none) (batch, m, n).
template <class T>
struct LinearOperands {
    const T* x;
    const T* weights;
    Extents extents;
    Epilogue<T> epilogue;
    T* out;
};

template <class T>
void linear_row_tiles(const LinearOperands<T>& operands) {
    const Extents& e = operands.extents;
    const std::vector<PackedMatrix<T>> packed =
        pack_all(RightMatrix<T>{operands.weights, 1, e.k}, e.batch, e.n * e.k, e.k, e.n);
    const std::int64_t tiles = chunk_count(e.m, tile_rows);
    parallel_for(e.batch * tiles, 1, [&](std::int64_t index, std::int64_t) {
        const std::int64_t sample = index / tiles;
        const std::int64_t first = sample * e.m + index % tiles * tile_rows;
        Epilogue<T> epilogue = operands.epilogue;
        if (epilogue.slope != nullptr) epilogue.slope += first * e.n;
        multiply_packed<T>(operands.out + first * e.n, e.n, {operands.x + first * e.k, e.k},
                           std::min(tile_rows, (sample + 1) * e.m - first),
                           packed[static_cast<std::size_t>(sample)], epilogue);
    });
}

/// For few rows: packing the weights would take longer than the product.
template <class T>
void linear_few_rows(const LinearOperands<T>& operands) {
    const Extents& e = operands.extents;
    for (std::int64_t sample = 0; sample < e.batch; ++sample) {
        T* const out = operands.out + sample * e.m * e.n;
        multiply_few(operands.x + sample * e.m * e.k, operands.weights + sample * e.n * e.k, out,
                     e);
        Epilogue<T> epilogue = operands.epilogue;
        if (epilogue.bias != nullptr) {
            for (std::int64_t i = 0; i < e.m * e.n; ++i) out[i] += epilogue.bias[i % e.n];
        }
        epilogue.bias = nullptr;
        epilogue.present_values = true;
        if (epilogue.slope != nullptr) epilogue.slope += sample * e.m * e.n;
        // A product without an inner length: the epilogue alone.
        multiply_packed<T>(out, e.n, {operands.x, 0}, e.m,
                           PackedMatrix<T>(operands.weights, 0, e.n, 1, 1), epilogue);
    }
}

}  // namespace

LinearResult linear(const Tensor& x, const Tensor& weight, const Tensor& bias,
                    Activation activation, bool with_slope) {
    Extents e{x.shape(0), x.shape(1), weight.shape(1), x.shape(2)};
    LinearResult result{Tensor({e.batch, e.m, e.n}, x.dtype()), {}};
    if (with_slope) result.slope = Tensor(result.value.shape(), x.dtype());
    if (weight.shape(0) == 1) {
        e.m *= e.batch;
        e.batch = 1;
    }
    dispatch(x.dtype(), [&]<class T>(T) {
        const LinearOperands<T> operands{
            x.values<T>().data(),
            weight.values<T>().data(),
            e,
            {.bias = bias.defined() ? bias.values<T>().data() : nullptr,
             .activation = activation,
             .slope = with_slope ? result.slope.mutable_values<T>().data() : nullptr},
            result.value.mutable_values<T>().data()};
        if (e.m <= few) {
            linear_few_rows(operands);
        } else {
            linear_row_tiles(operands);
        }
    });
    return result;
}

}  // namespace stymo::kernels
