#include "nn/optim/ema.h"

#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

template <class T>
void blend(Tensor& average, const Tensor& value, double decay) {
    const std::span<T> a = average.mutable_values<T>();
    const std::span<const T> x = value.values<T>();
    const T rest = static_cast<T>(1.0 - decay);
    constexpr std::int64_t grain = 1 << 14;
    parallel_for(value.size(), grain, [=](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
            a[i] += rest * (x[i] - a[i]);
    });
}

}  // namespace

Ema::Ema(std::vector<Parameter> parameters) : parameters_(std::move(parameters)) {
    for (const Parameter& parameter : parameters_)
        averages_.push_back(parameter.variable().value());
}

void Ema::update(double decay) {
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
        const Tensor& value = parameters_[i].variable().value();
        dispatch(value.dtype(),
                 [&](auto zero) { blend<decltype(zero)>(averages_[i], value, decay); });
    }
}

void Ema::swap() {
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
        Tensor value = parameters_[i].variable().value();
        parameters_[i].set_value(std::move(averages_[i]));
        averages_[i] = std::move(value);
    }
}

void Ema::save(TensorFile& file, const std::string& prefix) const {
    for (std::size_t i = 0; i < parameters_.size(); ++i)
        file.tensors.insert_or_assign(prefix + parameters_[i].name(), averages_[i]);
}

void Ema::load(const TensorFile& file, const std::string& source, const std::string& prefix) {
    std::vector<Tensor> loaded;
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
        const std::string name = prefix + parameters_[i].name();
        const auto entry = file.tensors.find(name);
        if (entry == file.tensors.end()) fail<FileError>(source, ": has no tensor ", name);
        if (!(entry->second.shape() == averages_[i].shape()))
            fail<FileError>(source, ": ", name, " has shape ", entry->second.shape(),
                            ", the model needs ", averages_[i].shape());
        loaded.push_back(entry->second.to(averages_[i].dtype()));
    }
    averages_ = std::move(loaded);
}

double ema_decay(std::int64_t batch, double half_life_images) {
    if (half_life_images <= 0.0) return 0.0;
    return std::pow(0.5, static_cast<double>(batch) / half_life_images);
}

}  // namespace stymo
