#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/tensor.h"

namespace stymo::test {

using Index = std::vector<std::int64_t>;

/// A row-major array for reference values written as plain loops over indices; shares no code with
/// the library's kernels.
struct Array {
    std::vector<std::int64_t> extents;
    std::vector<double> values;

    [[nodiscard]] std::int64_t extent(std::size_t axis) const { return extents[axis]; }
    [[nodiscard]] double& at(const Index& index) { return values[offset(index)]; }
    [[nodiscard]] double at(const Index& index) const { return values[offset(index)]; }
    /// The element that broadcasting (aligned at the last axis, extents 1 repeated) shows at
    /// `index`.
    [[nodiscard]] double broadcast_at(const Index& index) const;
    [[nodiscard]] std::size_t offset(const Index& index) const;
};

/// Calls `visit` with every index of an array of these extents, in row-major order.
void for_each_index(const std::vector<std::int64_t>& extents,
                    const std::function<void(const Index&)>& visit);
/// The array whose element at each index is `element(index)`.
[[nodiscard]] Array generate(const std::vector<std::int64_t>& extents,
                             const std::function<double(const Index&)>& element);

[[nodiscard]] Array to_array(const Tensor& tensor);
[[nodiscard]] Tensor to_tensor(const Array& array);

}  // namespace stymo::test
