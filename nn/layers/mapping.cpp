#include "nn/layers/mapping.h"

#include "core/error.h"

namespace stymo {

Mapping::Mapping(ParameterStore& store, const std::string& prefix, std::int64_t size,
                 std::int64_t layers, double learning_rate_multiplier, Rng& rng) {
    if (layers < 1)
        fail<ValueError>("mapping network ", prefix, " needs at least one layer, got ", layers);
    for (std::int64_t i = 0; i < layers; ++i) {
        const Activation activation = i + 1 < layers ? Activation::leaky_relu : Activation::none;
        layers_.emplace_back(store, prefix + ".layer" + std::to_string(i), size, size,
                             LinearOptions{.activation = activation,
                                           .learning_rate_multiplier = learning_rate_multiplier},
                             rng);
    }
}

Variable Mapping::operator()(const Variable& z) const {
    Variable x = z;
    for (const Linear& layer : layers_) x = layer(x);
    return x;
}

}  // namespace stymo
