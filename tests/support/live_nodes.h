#pragma once

#include <cstdint>

#include "core/autograd/node.h"

namespace stymo::test {

/// Counts the graph nodes that are alive beyond those that were alive when it was made.
class LiveNodes {
public:
    [[nodiscard]] std::int64_t added() const { return Node::live_count() - start_; }

private:
    std::int64_t start_ = Node::live_count();
};

}  // namespace stymo::test
