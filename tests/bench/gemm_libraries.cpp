#include "bench/gemm_libraries.h"

#include <omp.h>

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/tensor_eigen.h"
#ifdef STYMO_BENCH_OPENBLAS
#include <cblas.h>
#endif
#ifdef STYMO_BENCH_ONEDNN
#include <dnnl.h>
#endif
#ifdef STYMO_BENCH_LIBXSMM
#include <libxsmm.h>

#include "core/parallel.h"
#endif

namespace stymo::test {
namespace {

/// One product of row-major matrices: c (m, n) = op(a) op(b), rows `lda` and `ldb` apart.
struct Product {
    bool transpose_a, transpose_b;
    std::int64_t m, n, k;
    const float* a;
    std::int64_t lda;
    const float* b;
    std::int64_t ldb;
    float* c;
};

/// Calls `multiply` for each product of a batch.
template <class Multiply>
GemmLibrary library(const char* name, Multiply multiply) {
    return {name, [multiply](const Tensor& a, const Tensor& b, const MatmulOptions& options) {
                const std::int64_t rows_a = a.shape(1), columns_a = a.shape(2), rows_b = b.shape(1),
                                   columns_b = b.shape(2);
                const std::int64_t m = options.transpose_a ? columns_a : rows_a,
                                   k = options.transpose_a ? rows_a : columns_a,
                                   n = options.transpose_b ? rows_b : columns_b;
                Tensor result({a.shape(0), m, n});
                const float* const values_a = a.values<float>().data();
                const float* const values_b = b.values<float>().data();
                float* const values = result.mutable_values<float>().data();
                for (std::int64_t i = 0; i < a.shape(0); ++i)
                    multiply(Product{options.transpose_a, options.transpose_b, m, n, k,
                                     values_a + i * m * k, columns_a, values_b + i * k * n,
                                     columns_b, values + i * m * n});
                return result;
            }};
}

void multiply_by_eigen(const Product& p) {
    using Matrix = Eigen::Map<const RowMajorMatrix<float>>;
    const Matrix a(p.a, p.transpose_a ? p.k : p.m, p.lda);
    const Matrix b(p.b, p.transpose_b ? p.n : p.k, p.ldb);
    Eigen::Map<RowMajorMatrix<float>> c(p.c, p.m, p.n);
    if (p.transpose_a) {
        c.noalias() = a.transpose() * b;
    } else if (p.transpose_b) {
        c.noalias() = a * b.transpose();
    } else {
        c.noalias() = a * b;
    }
}

#ifdef STYMO_BENCH_LIBXSMM
/// libxsmm makes kernels for one thread and column-major matrices, c^T = b^T a^T, in which a is not
/// transposed. Blocks of 64 rows, as many columns and a part of the inner axis at a time.
void multiply_by_libxsmm(const Product& p) {
    constexpr std::int64_t block = 64, inner = 512;
    parallel_for(p.m, block, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t column = 0; column < p.n; column += block) {
            const std::int64_t columns = std::min(block, p.n - column);
            for (std::int64_t k = 0; k < p.k; k += inner) {
                const auto kernel = libxsmm_smmdispatch(
                    static_cast<int>(columns), static_cast<int>(end - begin),
                    static_cast<int>(std::min(inner, p.k - k)), std::array{int(p.ldb)}.data(),
                    std::array{int(p.lda)}.data(), std::array{int(p.n)}.data(), nullptr,
                    std::array{k == 0 ? 0.0F : 1.0F}.data(), nullptr, nullptr);
                if (kernel == nullptr) fail<Error>("libxsmm makes no kernels for this processor");
                kernel(p.b + k * p.ldb + column, p.a + begin * p.lda + k,
                       p.c + begin * p.n + column);
            }
        }
    });
}
#endif

}  // namespace

std::vector<GemmLibrary> gemm_libraries(int threads) {
    omp_set_num_threads(threads);
    std::vector<GemmLibrary> libraries{library("Eigen", multiply_by_eigen)};
#ifdef STYMO_BENCH_OPENBLAS
    openblas_set_num_threads(threads);
    libraries.push_back(library("OpenBLAS", [](const Product& p) {
        cblas_sgemm(CblasRowMajor, p.transpose_a ? CblasTrans : CblasNoTrans,
                    p.transpose_b ? CblasTrans : CblasNoTrans, static_cast<int>(p.m),
                    static_cast<int>(p.n), static_cast<int>(p.k), 1.0F, p.a,
                    static_cast<int>(p.lda), p.b, static_cast<int>(p.ldb), 0.0F, p.c,
                    static_cast<int>(p.n));
    }));
#endif
#ifdef STYMO_BENCH_ONEDNN
    libraries.push_back(library("oneDNN", [](const Product& p) {
        dnnl_sgemm(p.transpose_a ? 'T' : 'N', p.transpose_b ? 'T' : 'N', p.m, p.n, p.k, 1.0F, p.a,
                   p.lda, p.b, p.ldb, 0.0F, p.c, p.n);
    }));
#endif
#ifdef STYMO_BENCH_LIBXSMM
    libxsmm_init();
    const GemmLibrary libxsmm = library("libxsmm", multiply_by_libxsmm);
    libraries.push_back(
        {libxsmm.name, [multiply = libxsmm.multiply](const Tensor& a, const Tensor& b,
                                                     const MatmulOptions& options) {
             if (options.transpose_a || options.transpose_b) return Tensor();
             return multiply(a, b, options);
         }});
#endif
    return libraries;
}

}  // namespace stymo::test
