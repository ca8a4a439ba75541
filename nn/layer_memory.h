#pragma once

#include <algorithm>
#include <cstdint>

namespace stymo {

/// What a part of a network needs for a forward pass and the backward pass behind it, in numbers of
/// the model's type. The weights are not counted.
struct LayerMemory {
    std::int64_t saved = 0;    ///< kept for the backward pass
    std::int64_t passing = 0;  ///< needed for a moment beside it, at most

    /// Another part, before or after this one.
    void add(const LayerMemory& other) {
        saved += other.saved;
        passing = std::max(passing, other.passing);
    }
};

}  // namespace stymo
