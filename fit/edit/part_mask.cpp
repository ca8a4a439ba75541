#include "fit/edit/part_mask.h"

#include <algorithm>

namespace stymo {

Tensor part_mask(const Tensor& classes, const ParsingClassSet& parts) {
    Tensor mask(classes.shape());
    std::ranges::transform(
        classes.values<float>(), mask.mutable_values<float>().begin(),
        [&](float part) { return parts[static_cast<std::size_t>(part)] ? 1.0F : 0.0F; });
    return mask;
}

ParsingClassSet head_of_parts() {
    ParsingClassSet parts{};
    for (std::size_t part = 0; part < parts.size(); ++part)
        parts[part] = is_head_class(static_cast<int>(part));
    return parts;
}

}  // namespace stymo
