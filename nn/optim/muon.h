#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>

#include "core/io/tensor_file.h"
#include "nn/optim/adam.h"
#include "nn/parameter_store.h"

namespace stymo {

/// Approximates the nearest matrix with orthonormal rows or columns, whichever are fewer, by five
/// steps of the quintic Newton-Schulz iteration of Jordan et al. 2024. The singular values of a
/// matrix (R, C) of any magnitude become 0.6 to 1.3, except for ones that are very small beside the
/// largest. A zero matrix stays zero. Throws ShapeError unless the rank is 2.
[[nodiscard]] Tensor orthogonalised(const Tensor& matrix);

struct MuonOptions {
    double momentum = 0.95;  ///< in [0, 1): share of the earlier direction that stays
};

/// Muon (Jordan et al. 2024), an optimiser for the matrices of hidden layers: it orthogonalises the
/// direction of Nesterov momentum. The elements of a step have a root mean square close to
/// the learning rate, so learning rates are comparable with Adam's. The momentum is stored by
/// parameter name.
class Muon {
public:
    explicit Muon(const MuonOptions& options = {}) : options_(options) {}

    /// Updates each parameter (R, C) with its gradient; convolution weights (R, K, K, C) are
    /// matrices (R, K K C). Throws ValueError unless there is one gradient for each parameter,
    /// ShapeError for a parameter of fewer dimensions or a gradient of another shape, and
    /// NumericError, which names the parameter, before anything changes if a gradient is not
    /// finite.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              double learning_rate);

    /// Adds `prefix`<name>.momentum of every parameter.
    void save(TensorFile& file, const std::string& prefix) const;
    /// Replaces all momenta by those that `save` wrote under the same prefix.
    void load(const TensorFile& file, const std::string& prefix);

private:
    MuonOptions options_;
    std::map<std::string, Tensor, std::less<>> momenta_;
};

/// A learning rate. It is multiplied by `prefix_factor` for parameters whose name begins with
/// `prefix`, and by `adam_factor` for those that Adam moves.
struct OptimizerRates {
    double learning_rate = 0.0;
    std::string_view prefix{};
    double prefix_factor = 1.0;
    double adam_factor = 1.0;
};

/// The networks whose hidden matrices (both sides at least 16) Muon moves. In the encoder these
/// include the weights of convolutions.
enum class MuonScope { none, decoder, encoder_and_decoder };

/// The optimiser of encoder and decoder in training, and of the decoder in tuning: Muon for a scope
/// and Adam for the rest.
class HybridOptimizer {
public:
    HybridOptimizer(const AdamOptions& adam, MuonScope scope, const MuonOptions& muon = {})
        : adam_(adam), muon_(muon), scope_(scope) {}

    /// Updates each parameter with its gradient; there must be one for each. Throws what Adam::step
    /// and Muon::step throw.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              const OptimizerRates& rates);

    /// Adds the state of both optimisers, under `prefix`adam.* and `prefix`muon.*.
    void save(TensorFile& file, const std::string& prefix) const;
    /// Replaces the state by the one that `save` wrote. Parameters that are not in the file begin
    /// without state. Throws FileError, which names `source`, for an incomplete entry.
    void load(const TensorFile& file, const std::string& source, const std::string& prefix);

private:
    Adam adam_;
    Muon muon_;
    MuonScope scope_;
};

}  // namespace stymo
