#pragma once

#include <span>
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

}  // namespace stymo
