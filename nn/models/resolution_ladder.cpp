#include "nn/models/resolution_ladder.h"

#include <algorithm>

#include "core/error.h"

namespace stymo {

ResolutionLadder::ResolutionLadder(std::int64_t smallest, std::int64_t largest) {
    for (std::int64_t side = smallest; side > 0 && side <= largest; side *= 2)
        sides_.push_back(side);
    if (sides_.empty() || sides_.back() != largest)
        fail<ValueError>("a side of ", largest, " pixels is not ", smallest,
                         " doubled any number of times");
}

std::size_t ResolutionLadder::count_up_to(std::int64_t side) const {
    if (side == 0) return count();
    const auto found = std::ranges::find(sides_, side);
    if (found == sides_.end())
        fail<ValueError>("this model renders images with a side of ", text(), ", not ", side);
    return static_cast<std::size_t>(found - sides_.begin()) + 1;
}

ResolutionLadder ResolutionLadder::up_to(std::int64_t side) const {
    return {smallest(), sides_[count_up_to(side) - 1]};
}

std::string ResolutionLadder::text() const {
    std::string list;
    for (const std::int64_t side : sides_)
        list += (list.empty() ? "" : ", ") + std::to_string(side);
    return list;
}

}  // namespace stymo
