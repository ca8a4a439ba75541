#include "core/kernels/index.h"

#include <algorithm>

#include "core/kernels/map.h"

namespace stymo::kernels {

Tensor gather_rows(const Tensor& x, const RowIndices& rows) {
    const std::int64_t width = x.shape().product(1, x.rank());
    Tensor y(x.shape().with(0, static_cast<std::int64_t>(rows.size())), x.dtype());
    dispatch(x.dtype(), [&]<class T>(T) {
        const T* in = x.values<T>().data();
        T* out = y.mutable_values<T>().data();
        const std::int64_t grain =
            std::max<std::int64_t>(1, elementwise_grain / std::max<std::int64_t>(1, width));
        parallel_for(static_cast<std::int64_t>(rows.size()), grain,
                     [&](std::int64_t begin, std::int64_t end) {
                         for (std::int64_t i = begin; i < end; ++i)
                             std::copy_n(in + rows[static_cast<std::size_t>(i)] * width, width,
                                         out + i * width);
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
