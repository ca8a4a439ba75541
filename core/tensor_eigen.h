#pragma once

#include <Eigen/Core>
#include <array>

#include "core/error.h"
#include "core/tensor.h"

/// Views of tensors as Eigen matrices, without a copy, and conversion back. A map is valid as long
/// as the tensor from which it was made; it does not keep the elements alive. The element type T is
/// float or double. Every function throws TypeError if the tensor has another type.
namespace stymo {

template <class T>
using RowMajorMatrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

namespace tensor_eigen {

/// Rows and columns of `matrix_map`.
inline std::array<Eigen::Index, 2> matrix_extents(const Tensor& tensor) {
    if (tensor.rank() == 0) fail<ShapeError>("[matrix_map] needs one axis or more, got none");
    const Eigen::Index columns = tensor.shape(tensor.rank() - 1);
    Eigen::Index rows = 1;
    for (int axis = 0; axis + 1 < tensor.rank(); ++axis) rows *= tensor.shape(axis);
    return {rows, columns};
}

}  // namespace tensor_eigen

/// A tensor as a matrix: the last extent is the number of columns, the product of the others the
/// number of rows. Throws ShapeError for a tensor without axes.
template <class T>
[[nodiscard]] Eigen::Map<const RowMajorMatrix<T>> matrix_map(const Tensor& tensor) {
    const auto values = tensor.values<T>();
    const auto [rows, columns] = tensor_eigen::matrix_extents(tensor);
    return {values.data(), rows, columns};
}
/// The same to write to. The tensor copies its elements first if another one shares them.
template <class T>
[[nodiscard]] Eigen::Map<RowMajorMatrix<T>> mutable_matrix_map(Tensor& tensor) {
    const auto values = tensor.mutable_values<T>();
    const auto [rows, columns] = tensor_eigen::matrix_extents(tensor);
    return {values.data(), rows, columns};
}

/// A tensor (rows, columns) with the elements of a matrix or expression; (size) if its type is a
/// vector.
template <class Derived>
[[nodiscard]] Tensor tensor_from(const Eigen::DenseBase<Derived>& matrix) {
    using T = typename Derived::Scalar;
    Tensor result({matrix.rows(), matrix.cols()}, dtype_of<T>());
    mutable_matrix_map<T>(result) = matrix.derived();
    if constexpr (Derived::IsVectorAtCompileTime) return result.reshaped({matrix.size()});
    return result;
}

}  // namespace stymo
