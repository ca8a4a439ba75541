#include "nn/optim/hybrid_optimizer.h"

#include <algorithm>
#include <array>
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

/// Parameters without the prefix, and those with it.
using Groups = std::array<Group, 2>;

}  // namespace

void HybridOptimizer::step(std::span<const Parameter> parameters,
                           std::span<const Variable> gradients, const OptimizerRates& rates) {
    Groups matrices, others;
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        Groups& groups = with_muon_ && is_hidden_matrix(parameters[i]) ? matrices : others;
        Group& group = groups[parameters[i].name().starts_with(rates.prefix) ? 1 : 0];
        group.parameters.push_back(parameters[i]);
        group.gradients.push_back(gradients[i]);
    }
    for (std::size_t i = 0; i < 2; ++i) {
        const double rate = rates.learning_rate * (i == 1 ? rates.prefix_factor : 1.0);
        adam_.step(others[i].parameters, others[i].gradients, rate * rates.adam_factor);
        muon_.step(matrices[i].parameters, matrices[i].gradients, rate);
    }
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
