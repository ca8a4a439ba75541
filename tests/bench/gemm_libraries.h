#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/ops/linalg.h"

namespace stymo::test {

/// Another library's product of float32 matrices.
struct GemmLibrary {
    std::string name;
    /// The same as kernels::matmul: (batch, m, k) times (batch, k, n), each transposed or not. Null
    /// where the library has no such product.
    std::function<Tensor(const Tensor& a, const Tensor& b, const MatmulOptions& options)> multiply;
};

/// Eigen, and of OpenBLAS, oneDNN and libxsmm those that were installed when the build was
/// configured, each on this number of threads.
[[nodiscard]] std::vector<GemmLibrary> gemm_libraries(int threads);

}  // namespace stymo::test
