#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/parameter_store.h"

namespace stymo {

/// Exponential moving average of parameters. It begins with their current values.
class Ema {
public:
    explicit Ema(std::vector<Parameter> parameters);

    /// average = decay * average + (1 - decay) * parameter
    void update(double decay);
    /// Swaps averages and parameters: once to evaluate or save the averages, once more to continue
    /// training.
    void swap();

    /// Adds each average under `prefix` and the parameter's name.
    void save(TensorFile& file, const std::string& prefix) const;
    /// Throws FileError, which names `source` and the first tensor that is missing or has another
    /// shape.
    void load(const TensorFile& file, const std::string& source, const std::string& prefix);

private:
    std::vector<Parameter> parameters_;
    std::vector<Tensor> averages_;
};

/// Decay of an exponential moving average for one step of `batch` images: 0.5^(batch /
/// half_life_images). StyleGAN2 uses a half life of 10,000 images.
[[nodiscard]] double ema_decay(std::int64_t batch, double half_life_images);

}  // namespace stymo
