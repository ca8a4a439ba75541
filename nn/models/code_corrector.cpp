#include "nn/models/code_corrector.h"

#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {
namespace {

/// Gradients times this are about 1 at the codes of photos.
constexpr double gradient_scale = 300.0;
constexpr std::int64_t width = 256;

}  // namespace

CodeCorrector::CodeCorrector(ParameterStore& store, const std::string& prefix, std::int64_t errors,
                             Rng& rng)
    : errors_(errors),
      preconditioner_(store, prefix + ".preconditioner", errors * code_size, code_size,
                      {.initial_weight_scale = 0.0}, rng),
      wide_(store, prefix + ".wide", errors * (code_size + 1) + code_size, width,
            {.activation = Activation::leaky_relu}, rng),
      narrow_(store, prefix + ".narrow", width, width, {.activation = Activation::leaky_relu}, rng),
      last_(store, prefix + ".last", width, code_size, {.initial_weight_scale = 0.0}, rng) {}

Variable CodeCorrector::operator()(const Variable& codes, std::span<const Tensor> gradients) const {
    if (std::ssize(gradients) != errors_)
        fail<ShapeError>("codes are corrected by ", errors_, " gradients, not ", gradients.size());
    std::vector<Variable> scaled, seen{codes.detach()};
    for (const Tensor& gradient : gradients) {
        scaled.push_back(Variable(gradient) * gradient_scale);
        const Variable length = sqrt(mean(square(scaled.back()), {1}) + 1e-12);
        seen.push_back(scaled.back() / length);
        seen.push_back(log(length));
    }
    return codes + preconditioner_(concat(scaled, 1)) + last_(narrow_(wide_(concat(seen, 1))));
}

}  // namespace stymo
