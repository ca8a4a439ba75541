#include <algorithm>
#include <vector>

#include "core/kernels/gemm.h"
#include "core/kernels/map.h"
#include "core/kernels/matmul.h"

namespace stymo::kernels {

namespace {

/// Rows whose sums are added up by one thread.
constexpr std::int64_t piece_rows = 1024;
/// Rows that are computed at once: their inputs and outputs stay in the second-level cache.
constexpr std::int64_t tile_rows = 256;

template <class T>
struct Layer {
    std::int64_t batch, rows, in, out;  ///< if the weight is shared, the batch counts as rows
    const T* dL_dy;
    const T* y;
    const T* x;
    std::vector<PackedMatrix<T>> weights;  ///< of each member of the batch, if x is wanted
    T positive;                            ///< slopes of the activation
    T negative;
    T* dL_dx;

    [[nodiscard]] std::int64_t pieces() const { return chunk_count(rows, piece_rows); }
};

/// The contribution of one piece to the sums over rows; null: not wanted.
template <class T>
struct PieceSums {
    T* weight;  ///< (out, in)
    T* bias;    ///< (out), zeros at first
};

/// dL_dz = dL_dy times the slope, of so many rows, and its sum over them.
template <class T>
void gate(const Layer<T>& layer, std::int64_t first, std::int64_t rows, T* dL_dz, T* sums) {
    for (std::int64_t row = 0; row < rows; ++row, dL_dz += layer.out) {
        const T* const gradient = layer.dL_dy + (first + row) * layer.out;
        const T* const value = layer.y + (first + row) * layer.out;
#pragma omp simd
        for (std::int64_t i = 0; i < layer.out; ++i)
            dL_dz[i] = gradient[i] * (value[i] > T(0) ? layer.positive : layer.negative);
        if (sums == nullptr) continue;
#pragma omp simd
        for (std::int64_t i = 0; i < layer.out; ++i) sums[i] += dL_dz[i];
    }
}

template <class T>
void differentiate_piece(const Layer<T>& layer, std::int64_t member, std::int64_t piece,
                         const PieceSums<T>& sums) {
    std::vector<T> room(static_cast<std::size_t>(tile_rows * layer.out));
    T* const dL_dz = room.data();
    const std::int64_t begin = piece * piece_rows, end = std::min(begin + piece_rows, layer.rows);
    for (std::int64_t row = begin; row < end; row += tile_rows) {
        const std::int64_t rows = std::min(tile_rows, end - row), first = member * layer.rows + row;
        gate(layer, first, rows, dL_dz, sums.bias);
        if (layer.dL_dx != nullptr)
            multiply_packed<T>(layer.dL_dx + first * layer.in, layer.in, {dL_dz, layer.out}, rows,
                               layer.weights[static_cast<std::size_t>(member)]);
        if (sums.weight != nullptr)
            multiply_packed<T>(
                sums.weight, layer.in, {dL_dz, 1, layer.out}, layer.out,
                PackedMatrix<T>(layer.x + first * layer.in, rows, layer.in, layer.in, 1),
                {.present_values = row > begin});
    }
}

/// to (count) = the sum of so many rows of `from`, in their order.
template <class T>
void add_rows(T* to, const T* from, std::int64_t rows, std::int64_t count) {
    std::copy_n(from, count, to);
    for (std::int64_t row = 1; row < rows; ++row) {
#pragma omp simd
        for (std::int64_t i = 0; i < count; ++i) to[i] += from[row * count + i];
    }
}

template <class T>
void differentiate(const Layer<T>& layer, T* dL_dweight, T* dL_dbias) {
    const std::int64_t pieces = layer.pieces(), all = layer.batch * pieces;
    const std::int64_t size = layer.out * layer.in;
    std::vector<T> weights(static_cast<std::size_t>(dL_dweight != nullptr ? all * size : 0));
    std::vector<T> biases(static_cast<std::size_t>(dL_dbias != nullptr ? all * layer.out : 0));
    parallel_for(all, 1, [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t i = first; i < last; ++i)
            differentiate_piece(layer, i / pieces, i % pieces,
                                {weights.empty() ? nullptr : weights.data() + i * size,
                                 biases.empty() ? nullptr : biases.data() + i * layer.out});
    });
    for (std::int64_t member = 0; member < layer.batch && dL_dweight != nullptr; ++member)
        add_rows(dL_dweight + member * size, weights.data() + member * pieces * size, pieces, size);
    if (dL_dbias != nullptr) add_rows(dL_dbias, biases.data(), all, layer.out);
}

}  // namespace

LinearGradients leaky_linear_gradients(const Tensor& dL_dy, const LeakyLinear& layer,
                                       bool shares_weight, LinearWanted wanted) {
    const Shape& shape = dL_dy.shape();
    const std::int64_t in =
        wanted.x ? layer.weight.shape(2) : (wanted.weight ? layer.x.shape(2) : 0);
    const std::int64_t members = shares_weight ? 1 : shape[0];
    LinearGradients gradients;
    if (wanted.x) gradients.x = Tensor({shape[0], shape[1], in}, dL_dy.dtype());
    // Zeros, in case there are no rows.
    if (wanted.weight) gradients.weight = Tensor::zeros({members, shape[2], in}, dL_dy.dtype());
    if (wanted.bias) gradients.bias = Tensor::zeros({shape[2]}, dL_dy.dtype());
    if (dL_dy.size() == 0) return gradients;
    dispatch(dL_dy.dtype(), [&]<class T>(T) {
        Layer<T> operands{members,
                          shape[0] * shape[1] / members,
                          in,
                          shape[2],
                          dL_dy.values<T>().data(),
                          layer.y.values<T>().data(),
                          wanted.weight ? layer.x.values<T>().data() : nullptr,
                          {},
                          static_cast<T>(layer.gain),
                          static_cast<T>(layer.gain * layer.slope),
                          wanted.x ? gradients.x.mutable_values<T>().data() : nullptr};
        for (std::int64_t member = 0; wanted.x && member < members; ++member)
            operands.weights.emplace_back(
                layer.weight.values<T>().data() + member * operands.out * in, operands.out, in, in,
                1);
        differentiate<T>(operands,
                         wanted.weight ? gradients.weight.mutable_values<T>().data() : nullptr,
                         wanted.bias ? gradients.bias.mutable_values<T>().data() : nullptr);
    });
    return gradients;
}

}  // namespace stymo::kernels
