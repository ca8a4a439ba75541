#pragma once

#include <map>
#include <span>
#include <string>

#include "core/io/tensor_file.h"
#include "nn/parameter_store.h"

namespace stymo {

/// Near the closest matrix with orthonormal rows or columns, whichever are fewer: five steps of the
/// quintic Newton-Schulz iteration of Jordan et al. 2024, which takes the singular values of a
/// matrix (R, C) of any magnitude to between 0.6 and 1.3, the smallest ones excepted. A matrix of
/// zeros stays as it is.
[[nodiscard]] Tensor orthogonalised(const Tensor& matrix);

/// Muon (Jordan et al. 2024), an optimiser for the matrices of hidden layers: Nesterov momentum of
/// 0.95, whose direction is orthogonalised. A step's elements have a root mean square near the
/// learning rate, so that learning rates compare with Adam's. What it remembers is kept by
/// parameter name.
class Muon {
public:
    /// Moves each parameter (R, C) against its gradient. Throws ValueError for another number of
    /// gradients than parameters, and ShapeError for one that is no matrix or does not fit.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              double learning_rate);

    /// Adds `prefix`<name>.momentum of every parameter.
    void save(TensorFile& file, const std::string& prefix) const;
    /// Replaces everything by what `save` wrote under the same prefix.
    void load(const TensorFile& file, const std::string& prefix);

private:
    std::map<std::string, Tensor, std::less<>> momenta_;
};

}  // namespace stymo
