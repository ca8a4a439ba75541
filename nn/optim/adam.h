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

/// Adam (Kingma and Ba 2015) with bias correction, as PyTorch's. What it remembers is kept by
/// parameter name, each with its own number of steps, so parameters may join late, pause, or be
/// stepped in groups with rates of their own.
class Adam {
public:
    explicit Adam(const AdamOptions& options = {}) : options_(options) {}

    /// Moves each parameter against its gradient. Throws ValueError for another number of gradients
    /// than parameters, ShapeError or TypeError for one that does not fit, NumericError naming the
    /// parameter, before anything changes, for one that is infinite or not a number. Elements
    /// beyond +-1e18, whose squares float32 does not hold, count as +-1e18.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              double learning_rate);

    /// Adds `prefix`<name>.first, .second and .steps of every parameter.
    void save(TensorFile& file, const std::string& prefix) const;
    /// Replaces everything by what `save` wrote under the same prefix; training goes on bit for
    /// bit. Throws FileError naming `source` for an entry that is incomplete.
    void load(const TensorFile& file, const std::string& source, const std::string& prefix);

private:
    struct Moments {
        Tensor first;
        Tensor second;
        std::int64_t steps = 0;
    };

    AdamOptions options_;
    std::map<std::string, Moments, std::less<>> moments_;
};

/// Name of the first parameter whose gradient is infinite or not a number, if there is one.
[[nodiscard]] std::optional<std::string> first_non_finite(std::span<const Parameter> parameters,
                                                          std::span<const Variable> gradients);

}  // namespace stymo
