#include "nn/layers/batch_norm.h"

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "core/ops/elementwise.h"

namespace stymo {

BatchNorm::BatchNorm(ParameterStore& store, const std::string& name, std::int64_t channels,
                     const BatchNormOptions& options)
    : weight_(options.fixed_weight
                  ? store.create_constant(name + ".weight", Tensor::full({channels}, 1.0))
                  : store.create(name + ".weight", Tensor::full({channels}, 1.0))),
      bias_(store.create(name + ".bias", Tensor::zeros({channels}))),
      running_mean_(store.create_constant(name + ".running_mean", Tensor::zeros({channels}))),
      running_variance_(store.create_constant(
          name + ".running_variance", Tensor::full({channels}, options.initial_variance))) {}

Variable BatchNorm::operator()(const Variable& x) const {
    const Variable factor = scale();
    return x * factor + shift(factor);
}

Variable BatchNorm::scale() const {
    const std::vector<double> variances = running_variance_.variable().value().to_vector();
    const auto refused =
        std::ranges::find_if(variances, [](double variance) { return !(variance >= 0.0); });
    if (refused != variances.end())
        fail<NumericError>(running_variance_.name(), ": a variance is ", *refused,
                           "; it must not be negative");
    return weight_.variable() / sqrt(running_variance_.variable() + epsilon);
}

Variable BatchNorm::shift(const Variable& scale) const {
    return bias_.variable() - running_mean_.variable() * scale;
}

}  // namespace stymo
