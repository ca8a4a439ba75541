#include "core/ops/sample_order.h"

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/error.h"

namespace stymo {

void require_ordered_samples(const char* function, const Tensor& deltas) {
    dispatch(deltas.dtype(), [&]<class T>(T) {
        const std::span<const T> values = deltas.values<T>();
        const auto refused = std::ranges::find_if(values, [](T delta) { return !(delta >= T(0)); });
        if (refused == values.end()) return;
        const std::int64_t index = refused - values.begin(), samples = deltas.shape(2), rays = deltas.shape(1);
        fail<ValueError>("[", function, "] deltas: interval ", index % samples, " of ray ", index / samples % rays,
                         " has length ", *refused, "; samples must be in order, away from the camera");
    });
}

}  // namespace stymo
