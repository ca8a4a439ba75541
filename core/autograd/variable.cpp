#include "core/autograd/variable.h"

#include "core/autograd/node.h"

namespace stymo {

Variable Variable::leaf(Tensor value) {
    return {std::move(value),
            std::make_shared<Node>("leaf", std::vector<Node::Input>{}, std::vector<VjpRule>{},
                                   Tensor{}, Save::none())};
}

}  // namespace stymo
