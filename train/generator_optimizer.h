#pragma once

#include <span>
#include <string>
#include <string_view>

#include "nn/optim/adam.h"
#include "nn/optim/muon.h"

namespace stymo {

/// The generator's learning rate; that of the parameters whose name begins with `prefix` is
/// `prefix_factor` times as large.
struct GeneratorRates {
    double learning_rate = 0.0;
    std::string_view prefix;
    double prefix_factor = 1.0;
};

/// Moves the generator's parameters: Adam, or Muon for the decoder's matrices and Adam for the
/// rest.
class GeneratorOptimizer {
public:
    GeneratorOptimizer(const AdamOptions& adam, bool muon) : adam_(adam), with_muon_(muon) {}

    /// Throws what Adam::step and Muon::step throw.
    void step(std::span<const Parameter> parameters, std::span<const Variable> gradients,
              const GeneratorRates& rates);

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
