#include "nn/models/codes.h"

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Variable joined(const Codes& codes) {
    return concat({codes.groups.begin(), codes.groups.end()}, 1);
}

Codes split_codes(const Variable& rows) {
    if (rows.rank() != 2 || rows.shape(1) != code_size)
        fail<ShapeError>("codes have ", code_size, " elements a row, got ", rows.shape());
    Codes codes;
    std::int64_t begin = 0;
    for (std::size_t i = 0; i < codes.groups.size(); ++i) {
        codes.groups[i] = slice(rows, 1, begin, begin + code_sizes[i]);
        begin += code_sizes[i];
    }
    return codes;
}

Codes codes_of_face(const Codes& codes, std::int64_t index) {
    Codes result;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        result.groups[group] = slice(codes.groups[group], 0, index, index + 1);
    return result;
}

Codes add(const Codes& a, const Codes& b) {
    Codes sum;
    for (std::size_t i = 0; i < sum.groups.size(); ++i) sum.groups[i] = a.groups[i] + b.groups[i];
    return sum;
}

Codes detached(const Codes& codes) {
    Codes result;
    for (std::size_t i = 0; i < result.groups.size(); ++i)
        result.groups[i] = codes.groups[i].detach();
    return result;
}

Variable squared_length(const Codes& codes) {
    Variable total;
    for (const Variable& group : codes.groups)
        total = total.defined() ? total + sum(square(group)) : sum(square(group));
    return total;
}

}  // namespace stymo
