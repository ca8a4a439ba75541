#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/parameter_store.h"

namespace stymo::test {

using LayerFunction = std::function<Variable(const std::vector<Variable>&)>;

/// One layer or loss on small inputs. The table is all that a new layer or loss is
/// entered for the tests.
struct LayerCase {
    std::string name;
    std::string
        covers;  ///< stem of the header in nn/layers, or name of the function in nn/losses.h
    std::vector<Shape> inputs;
    Shape output;
    std::function<LayerFunction(ParameterStore&, Rng&)> make;
};

[[nodiscard]] const std::vector<LayerCase>& layer_cases();

}  // namespace stymo::test
