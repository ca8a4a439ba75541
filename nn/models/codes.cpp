#include "nn/models/codes.h"

#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"

namespace stymo {

Codes add(const Codes& a, const Codes& b) {
    Codes sum;
    for (std::size_t i = 0; i < sum.groups.size(); ++i) sum.groups[i] = a.groups[i] + b.groups[i];
    return sum;
}

Codes detached(const Codes& codes) {
    Codes result;
    for (std::size_t i = 0; i < result.groups.size(); ++i) result.groups[i] = codes.groups[i].detach();
    return result;
}

Variable squared_length(const Codes& codes) {
    Variable total;
    for (const Variable& group : codes.groups) total = total.defined() ? total + sum(square(group)) : sum(square(group));
    return total;
}

}  // namespace stymo
