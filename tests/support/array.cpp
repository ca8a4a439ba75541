#include "support/array.h"

namespace stymo::test {

std::size_t Array::offset(const Index& index) const {
    std::int64_t result = 0;
    for (std::size_t axis = 0; axis < extents.size(); ++axis)
        result = result * extents[axis] + index.at(axis);
    return static_cast<std::size_t>(result);
}

double Array::broadcast_at(const Index& index) const {
    const std::size_t skipped = index.size() - extents.size();
    Index own(extents.size());
    for (std::size_t axis = 0; axis < extents.size(); ++axis)
        own[axis] = extents[axis] == 1 ? 0 : index[skipped + axis];
    return at(own);
}

void for_each_index(const std::vector<std::int64_t>& extents,
                    const std::function<void(const Index&)>& visit) {
    std::int64_t count = 1;
    for (const std::int64_t extent : extents) count *= extent;
    Index index(extents.size(), 0);
    for (std::int64_t i = 0; i < count; ++i) {
        visit(index);
        for (std::size_t axis = extents.size(); axis-- > 0;) {
            if (++index[axis] < extents[axis]) break;
            index[axis] = 0;
        }
    }
}

Array generate(const std::vector<std::int64_t>& extents,
               const std::function<double(const Index&)>& element) {
    Array array{extents, {}};
    for_each_index(extents, [&](const Index& index) { array.values.push_back(element(index)); });
    return array;
}

Array to_array(const Tensor& tensor) {
    const auto extents = tensor.shape().extents();
    return {{extents.begin(), extents.end()}, tensor.to_vector()};
}

Tensor to_tensor(const Array& array) {
    return Tensor::from(Shape(std::span<const std::int64_t>(array.extents)),
                        std::span<const double>(array.values));
}

}  // namespace stymo::test
