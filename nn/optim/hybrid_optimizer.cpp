#include "nn/optim/hybrid_optimizer.h"

#include <algorithm>
#include <vector>

namespace stymo {

namespace {

constexpr const char* adam_name = "adam.";
constexpr const char* muon_name = "muon.";

/// Whether Muon suits this parameter: a matrix of a hidden layer, not one to or from few channels.
bool is_hidden_matrix(const Parameter& parameter) {
    constexpr std::int64_t few = 16;
    const Shape& shape = parameter.variable().shape();
    return parameter.name().starts_with("decoder.") && shape.rank() == 2 &&
           std::min(shape[0], shape[1]) >= few;
}

struct Group {
    std::vector<Parameter> parameters;
    std::vector<Variable> gradients;
};

}  // namespace

void HybridOptimizer::step(std::span<const Parameter> parameters,
                           std::span<const Variable> gradients, const OptimizerRates& rates) {
    Group plain, prefixed, matrices;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const bool muon = with_muon_ && is_hidden_matrix(parameters[i]);
        Group& group = muon                                             ? matrices
                       : parameters[i].name().starts_with(rates.prefix) ? prefixed
                                                                        : plain;
        group.parameters.push_back(parameters[i]);
        group.gradients.push_back(gradients[i]);
    }
    const double adam_rate = rates.learning_rate * rates.adam_factor;
    adam_.step(plain.parameters, plain.gradients, adam_rate);
    adam_.step(prefixed.parameters, prefixed.gradients, adam_rate * rates.prefix_factor);
    muon_.step(matrices.parameters, matrices.gradients, rates.learning_rate);
}

void HybridOptimizer::save(TensorFile& file, const std::string& prefix) const {
    adam_.save(file, prefix + adam_name);
    muon_.save(file, prefix + muon_name);
}

void HybridOptimizer::load(const TensorFile& file, const std::string& source,
                           const std::string& prefix) {
    adam_.load(file, source, prefix + adam_name);
    muon_.load(file, prefix + muon_name);
}

}  // namespace stymo
