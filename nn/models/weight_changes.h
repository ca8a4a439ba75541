#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "nn/models/model.h"

namespace stymo {

/// What tuning to one photo has added to the weights of a model's decoder: a small file that goes
/// with the codes of that photo (pivotal tuning, Roich et al. 2022).
class WeightChanges {
public:
    /// Of the parameters that differ between two decoders of the same shape. Throws ValueError for
    /// decoders of different shapes.
    [[nodiscard]] static WeightChanges between(const Model& before, const Model& after);
    /// Throws FileError for a file that is malformed or holds something else.
    [[nodiscard]] static WeightChanges load(const std::filesystem::path& path);
    /// Elements of 16 bits. Whole or not at all.
    void save(const std::filesystem::path& path) const;

    /// Adds the changes to the weights. Throws ValueError unless this is the model that they were
    /// made for.
    void apply(Model& model) const;

    /// Those of the changed parameters, by name.
    [[nodiscard]] const std::map<std::string, Tensor>& differences() const { return differences_; }

private:
    std::string model_;  ///< fingerprint of the weights before the changes
    std::map<std::string, Tensor> differences_;
};

/// Tells models apart: a checksum over names and values of the decoder's parameters.
[[nodiscard]] std::string decoder_fingerprint(const Model& model);

}  // namespace stymo
