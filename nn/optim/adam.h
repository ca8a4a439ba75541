#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "core/io/tensor_file.h"
#include "nn/parameter_store.h"

namespace stymo {

struct AdamOptions {
    double beta1 = 0.9;
    double beta2 = 0.999;
    double epsilon = 1e-8;
};

/// Adam (Kingma and Ba 2015) with bias correction, like PyTorch's. Moments and the number of steps
/// are stored for each parameter name, so parameters may be added later, pause, or be updated in
/// groups with different learning rates.
class Adam {
public:
    explicit Adam(const AdamOptions& options = {}) : options_(options) {}

    /// Updates each parameter with its gradient. Throws ValueError unless there is one gradient for
    /// each parameter, ShapeError or TypeError for a gradient of another shape or type, and
    /// NumericError, which names the parameter, if a gradient is not finite. Then nothing has
    /// changed. Elements of gradients are clamped to +-1e18, since larger squares exceed float32.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              double learning_rate);

    /// Adds `prefix`<name>.first, .second and .steps of every parameter.
    void save(TensorFile& file, const std::string& prefix) const;
    /// Replaces the state by the one that `save` wrote under the same prefix, so that training
    /// continues with the same bits. Throws FileError, which names `source`, for an incomplete
    /// entry and for a number of steps that is none.
    void load(const TensorFile& file, const std::string& source, const std::string& prefix);

private:
    struct Moments {
        Tensor first;
        Tensor second;
        std::int64_t steps = 0;
    };

    void require_alike(const Parameter& parameter, const Tensor& gradient) const;

    AdamOptions options_;
    std::map<std::string, Moments, std::less<>> moments_;
};

/// Name of the first parameter whose gradient is infinite or not a number, if there is one.
[[nodiscard]] std::optional<std::string> first_non_finite(std::span<const Parameter> parameters,
                                                          std::span<const Variable> gradients);

}  // namespace stymo
