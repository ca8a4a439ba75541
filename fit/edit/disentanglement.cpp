#include "fit/edit/disentanglement.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {

namespace {

constexpr std::size_t groups = code_names.size();

double root_mean_square(const Variable& from, const Variable& to) {
    if (!(from.shape() == to.shape()))
        fail<ShapeError>("disentanglement: codes ", from.shape(), " and ", to.shape(),
                         " differ in shape");
    return std::sqrt(sum(square(to - from)).value().item() / static_cast<double>(from.shape(0)));
}

}  // namespace

GroupMatrix group_movements(const Codes& base, const Codes& other,
                            const std::array<Codes, groups>& changed) {
    GroupMatrix result{};
    for (std::size_t read = 0; read < groups; ++read) {
        const double whole = root_mean_square(base.groups[read], other.groups[read]);
        if (!(whole > 0.0))
            fail<NumericError>("disentanglement: the encoder reads the same ", code_names[read],
                               " codes of all faces");
        for (std::size_t replaced = 0; replaced < groups; ++replaced)
            result[replaced][read] =
                root_mean_square(base.groups[read], changed[replaced].groups[read]) / whole;
    }
    return result;
}

std::array<double, groups> largest_leaks(const GroupMatrix& movements) {
    std::array<double, groups> result{};
    for (std::size_t row = 0; row < groups; ++row)
        for (std::size_t column = 0; column < groups; ++column)
            if (column != row)
                result[row] = std::max(result[row], movements[row][column] / movements[row][row]);
    return result;
}

}  // namespace stymo
