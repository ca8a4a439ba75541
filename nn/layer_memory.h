#pragma once

#include <algorithm>
#include <cstdint>

namespace stymo {

/// Memory of a part of a network for a forward and a backward pass, in elements of the model's
/// type. Weights are not counted.
struct LayerMemory {
    std::int64_t saved = 0;      ///< kept for the backward pass
    std::int64_t transient = 0;  ///< largest temporary memory in addition to `saved`

    /// Adds a part that runs before or after this one.
    void add(const LayerMemory& other) {
        saved += other.saved;
        transient = std::max(transient, other.transient);
    }
};

}  // namespace stymo
