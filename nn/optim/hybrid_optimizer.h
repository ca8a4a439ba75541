#pragma once

#include <span>
#include <string>
#include <string_view>

#include "nn/optim/adam.h"
#include "nn/optim/muon.h"

namespace stymo {

/// A learning rate; that of the parameters whose name begins with `prefix` is `prefix_factor` times
/// as large.
struct OptimizerRates {
    double learning_rate = 0.0;
    std::string_view prefix;
    double prefix_factor = 1.0;
};

/// Adam, or Muon for the decoder's hidden matrices and Adam for the rest: what moves encoder and
/// decoder in training, and the decoder in tuning.
class HybridOptimizer {
public:
    HybridOptimizer(const AdamOptions& adam, bool muon) : adam_(adam), with_muon_(muon) {}

    /// Throws what Adam::step and Muon::step throw.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              const OptimizerRates& rates);

    /// Adds what the next step depends on, under `prefix`adam. and `prefix`muon. .
    void save(TensorFile& file, const std::string& prefix) const;
    /// Goes on from what `save` wrote; what the file does not have begins anew. Throws FileError
    /// naming `source` for an entry that is incomplete.
    void load(const TensorFile& file, const std::string& source, const std::string& prefix);

private:
    Adam adam_;
    Muon muon_;
    bool with_muon_;
};

}  // namespace stymo
