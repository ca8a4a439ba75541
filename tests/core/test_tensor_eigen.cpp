#include <catch2/catch.hpp>
#include <vector>

#include "core/tensor_eigen.h"

using namespace stymo;

namespace {

/// 0, 1, 2 and so on.
Tensor counted(const Shape& shape, DType dtype) {
    Tensor result(shape, dtype);
    dispatch(dtype, [&]<class T>(T) {
        T next = 0;
        for (T& value : result.mutable_values<T>()) value = next++;
    });
    return result;
}

}  // namespace

TEMPLATE_TEST_CASE("the matrix of a tensor has its last axis as columns", "", float, double) {
    const Tensor tensor = counted({2, 3, 4}, dtype_of<TestType>());
    const auto matrix = matrix_map<TestType>(tensor);
    CHECK(matrix.rows() == 6);
    CHECK(matrix.cols() == 4);
    CHECK(matrix.data() == tensor.values<TestType>().data());
    CHECK(matrix(4, 1) == TestType{17});
    CHECK(matrix_map<TestType>(counted({5}, dtype_of<TestType>())).rows() == 1);
    CHECK(matrix_map<TestType>(counted({0, 3}, dtype_of<TestType>())).size() == 0);
}

TEMPLATE_TEST_CASE("what is written to a tensor's matrix stays in that tensor", "", float, double) {
    Tensor tensor = counted({2, 3}, dtype_of<TestType>());
    const Tensor copy = tensor;
    mutable_matrix_map<TestType>(tensor).col(2) *= TestType{10};
    CHECK(tensor.to_vector() == std::vector<double>{0, 1, 20, 3, 4, 50});
    CHECK(copy.to_vector() == std::vector<double>{0, 1, 2, 3, 4, 5});
}

TEMPLATE_TEST_CASE("a tensor is made of a matrix, a vector or an expression", "", float, double) {
    Eigen::Matrix<TestType, 2, 3> matrix;
    matrix << 1, 2, 3, 4, 5, 6;
    const Tensor tensor = tensor_from(matrix);
    CHECK(tensor.dtype() == dtype_of<TestType>());
    CHECK(tensor.shape() == Shape{2, 3});
    CHECK(tensor.to_vector() == std::vector<double>{1, 2, 3, 4, 5, 6});
    const Tensor doubled = tensor_from(TestType{2} * matrix.transpose());
    CHECK(doubled.shape() == Shape{3, 2});
    CHECK(doubled.to_vector() == std::vector<double>{2, 8, 4, 10, 6, 12});
    CHECK(tensor_from(matrix.row(1)).shape() == Shape{3});
    CHECK(tensor_from(matrix.col(1)).to_vector() == std::vector<double>{2, 5});
    CHECK(matrix_map<TestType>(tensor) == matrix);
}

TEST_CASE("a map of another type than the tensor's is refused") {
    Tensor tensor = counted({2, 3}, DType::float32);
    CHECK_THROWS_AS(matrix_map<double>(tensor), TypeError);
    CHECK_THROWS_AS(mutable_matrix_map<double>(tensor), TypeError);
    CHECK_THROWS_AS(matrix_map<float>(Tensor::scalar(1.0)), ShapeError);
}
