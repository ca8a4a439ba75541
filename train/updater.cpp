#include "train/updater.h"

#include <cmath>

#include "core/ops/elementwise.h"

namespace stymo {

void GradientMean::add(const std::vector<Variable>& gradients) {
    const bool first = gradients_.empty();
    for (std::size_t i = 0; i < gradients.size(); ++i) {
        const Variable share = gradients[i] * part_;
        if (first) {
            gradients_.push_back(share);
            if (compensated_) excess_.push_back(Tensor::zeros(share.shape(), share.dtype()));
        } else if (compensated_) {
            const Variable corrected = share - excess_[i];
            const Variable total = gradients_[i] + corrected;
            excess_[i] = (total - gradients_[i]) - corrected;
            gradients_[i] = total;
        } else {
            gradients_[i] = gradients_[i] + share;
        }
    }
}

std::optional<std::string> non_finite(double loss, const std::vector<Parameter>& parameters,
                                      const std::vector<Variable>& gradients) {
    if (const std::optional<std::string> name = first_non_finite(parameters, gradients)) return name;
    return std::isfinite(loss) ? std::nullopt : std::optional<std::string>("the loss");
}

void step_in_two_groups(Adam& adam, const std::vector<Parameter>& parameters, const std::vector<Variable>& gradients,
                        double learning_rate, std::string_view prefix, double prefix_learning_rate) {
    for (const bool with_prefix : {false, true}) {
        std::vector<Parameter> group;
        std::vector<Variable> group_gradients;
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            if (parameters[i].name().starts_with(prefix) != with_prefix) continue;
            group.push_back(parameters[i]);
            group_gradients.push_back(gradients[i]);
        }
        adam.step(group, group_gradients, with_prefix ? prefix_learning_rate : learning_rate);
    }
}

}  // namespace stymo
