#include "nn/optim/adam.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {
namespace {

/// The square of such an element, and the moving average of squares, are within float32's range.
constexpr double largest_gradient = 1e18;

/// One step's factors; the two bias corrections are folded in as PyTorch does.
struct Factors {
    double beta1, beta2, epsilon, step_size, second_correction;
};

template <class T>
Tensor update(const Tensor& value, const Tensor& gradient, Tensor& first, Tensor& second,
              const Factors& factors) {
    Tensor updated(value.shape(), value.dtype());
    const std::span<const T> x = value.values<T>(), g = gradient.values<T>();
    const std::span<T> m = first.mutable_values<T>(), v = second.mutable_values<T>(),
                       y = updated.mutable_values<T>();
    const T beta1 = static_cast<T>(factors.beta1), beta2 = static_cast<T>(factors.beta2);
    const T rest1 = static_cast<T>(1.0 - factors.beta1),
            rest2 = static_cast<T>(1.0 - factors.beta2);
    const T epsilon = static_cast<T>(factors.epsilon),
            step_size = static_cast<T>(factors.step_size);
    const T correction = static_cast<T>(factors.second_correction);
    constexpr T largest = static_cast<T>(largest_gradient);
    constexpr std::int64_t grain = 1 << 14;
    parallel_for(value.size(), grain, [=](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
            const T slope = std::clamp(g[i], -largest, largest);
            m[i] = beta1 * m[i] + rest1 * slope;
            v[i] = beta2 * v[i] + rest2 * slope * slope;
            y[i] = x[i] - step_size * m[i] / (std::sqrt(v[i]) * correction + epsilon);
        }
    });
    return updated;
}

void require_pairs(std::span<const Parameter> parameters, std::span<const Variable> gradients) {
    if (parameters.size() != gradients.size())
        fail<ValueError>(gradients.size(), " gradients for ", parameters.size(), " parameters");
}

}  // namespace

void Adam::require_alike(const Parameter& parameter, const Tensor& gradient) const {
    const Tensor& value = parameter.variable().value();
    if (!(gradient.shape() == value.shape()))
        fail<ShapeError>("gradient of ", parameter.name(), " has shape ", gradient.shape(),
                         ", not ", value.shape());
    if (gradient.dtype() != value.dtype())
        fail<TypeError>("gradient of ", parameter.name(), " is ", gradient.dtype(), ", not ",
                        value.dtype());
    const auto known = moments_.find(parameter.name());
    if (known == moments_.end()) return;
    for (const Tensor* moment : {&known->second.first, &known->second.second})
        if (!(moment->shape() == value.shape()) || moment->dtype() != value.dtype())
            fail<ShapeError>("what the optimizer remembers of ", parameter.name(),
                             " has another shape or type than ", value.shape());
}

void Adam::step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
                double learning_rate) {
    if (const std::optional<std::string> name = first_non_finite(parameters, gradients))
        fail<NumericError>("the gradient of ", *name, " is not finite");
    for (std::size_t i = 0; i < parameters.size(); ++i)
        require_alike(parameters[i], gradients[i].value());
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const Tensor& value = parameters[i].variable().value();
        const Tensor& gradient = gradients[i].value();
        Moments& moments = moments_[parameters[i].name()];
        if (!moments.first.defined())
            moments = {Tensor::zeros(value.shape(), value.dtype()),
                       Tensor::zeros(value.shape(), value.dtype())};
        const auto steps = static_cast<double>(++moments.steps);
        const Factors factors{options_.beta1, options_.beta2, options_.epsilon,
                              learning_rate / (1.0 - std::pow(options_.beta1, steps)),
                              1.0 / std::sqrt(1.0 - std::pow(options_.beta2, steps))};
        parameters[i].set_value(dispatch(value.dtype(), [&](auto zero) {
            return update<decltype(zero)>(value, gradient, moments.first, moments.second, factors);
        }));
    }
}

void Adam::save(TensorFile& file, const std::string& prefix) const {
    for (const auto& [name, moments] : moments_) {
        file.tensors.insert_or_assign(prefix + name + ".first", moments.first);
        file.tensors.insert_or_assign(prefix + name + ".second", moments.second);
        file.tensors.insert_or_assign(
            prefix + name + ".steps",
            Tensor::full({1}, static_cast<double>(moments.steps), DType::float64));
    }
}

void Adam::load(const TensorFile& file, const std::string& source, const std::string& prefix) {
    std::map<std::string, Moments, std::less<>> loaded;
    for (const auto& [entry, tensor] : file.tensors) {
        if (!entry.starts_with(prefix)) continue;
        const std::string name = entry.substr(prefix.size(), entry.rfind('.') - prefix.size());
        if (loaded.contains(name)) continue;
        const auto first = file.tensors.find(prefix + name + ".first");
        const auto second = file.tensors.find(prefix + name + ".second");
        const auto steps = file.tensors.find(prefix + name + ".steps");
        const auto end = file.tensors.end();
        if (first == end || second == end || steps == end || steps->second.size() != 1)
            fail<FileError>(source, ": the state of the optimizer for ", name, " is incomplete");
        const double count = steps->second.item();
        constexpr double most = 9007199254740992.0;  // larger ones are not counted exactly
        if (!(count >= 0.0 && count <= most && count == std::floor(count)))
            fail<FileError>(source, ": ", count, " steps of the optimizer for ", name);
        loaded[name] = {first->second, second->second, static_cast<std::int64_t>(count)};
    }
    moments_ = std::move(loaded);
}

std::optional<std::string> first_non_finite(std::span<const Parameter> parameters,
                                            std::span<const Variable> gradients) {
    require_pairs(parameters, gradients);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (!gradients[i].value().all_finite()) return parameters[i].name();
    }
    return std::nullopt;
}

}  // namespace stymo
