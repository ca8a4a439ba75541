#include "nn/models/codes.h"

#include "core/ops/elementwise.h"

namespace stymo {

Codes add(const Codes& a, const Codes& b) {
    Codes sum;
    for (std::size_t i = 0; i < sum.groups.size(); ++i) sum.groups[i] = a.groups[i] + b.groups[i];
    return sum;
}

}  // namespace stymo
