#pragma once

#include <span>
#include <string>
#include <string_view>

#include "nn/optim/adam.h"
#include "nn/optim/muon.h"

namespace stymo {

/// A learning rate. It is multiplied by `prefix_factor` for parameters whose name begins with
/// `prefix`, and by `adam_factor` for those that Adam moves.
struct OptimizerRates {
    double learning_rate = 0.0;
    std::string_view prefix{};
    double prefix_factor = 1.0;
    double adam_factor = 1.0;
};

/// The optimiser of encoder and decoder in training, and of the decoder in tuning. Adam for all
/// parameters, or Muon for the decoder's hidden matrices (both sides at least 16) and Adam for the
/// rest.
class HybridOptimizer {
public:
    HybridOptimizer(const AdamOptions& adam, bool with_muon, const MuonOptions& muon = {})
        : adam_(adam), muon_(muon), with_muon_(with_muon) {}

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
    bool with_muon_;
};

}  // namespace stymo
