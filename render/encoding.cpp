#include "render/encoding.h"

#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {

Variable positional_encoding(const Variable& points, std::int64_t frequencies) {
    if (points.rank() == 0 || points.shape(-1) != 3)
        fail<ShapeError>("[positional_encoding] points must be (..., 3), got ", points.shape());
    if (frequencies < 0)
        fail<ValueError>(
            "[positional_encoding] the number of frequencies must not be negative, got ",
            frequencies);
    std::vector<Variable> parts{points};
    double frequency = 1.0;
    for (std::int64_t k = 0; k < frequencies; ++k) {
        const Variable phase = points * frequency;
        parts.push_back(sin(phase));
        parts.push_back(cos(phase));
        frequency *= 2.0;
    }
    return concat(parts, -1);
}

}  // namespace stymo
