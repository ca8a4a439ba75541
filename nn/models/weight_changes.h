#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "nn/models/codes.h"
#include "nn/models/model.h"

namespace stymo {

/// Changes of a decoder's weights by tuning to one photo (pivotal tuning, Roich et al. 2022). They
/// are stored in a small file next to the codes of that photo.
class WeightChanges {
public:
    /// The differences after - before of all parameters that differ, rounded to the 16 bits that
    /// the file has, so that a face looks the same before it is saved and after it is loaded.
    /// Throws ValueError for decoders of different shapes and for a difference beyond the range of
    /// 16-bit numbers.
    [[nodiscard]] static WeightChanges between(const Model& before, const Model& after);
    /// Throws FileError for a file that is malformed or holds something else.
    [[nodiscard]] static WeightChanges load(const std::filesystem::path& path);
    /// Writes the differences as 16-bit numbers, completely or not at all.
    void save(const std::filesystem::path& path) const;

    /// Names the face that the decoder was tuned for, by the identity of row 0.
    void name_face(const Codes& codes);
    /// Whether row 0 is that face, by its identity; also if none is named. Codes whose expression,
    /// texture or light was edited are.
    [[nodiscard]] bool are_of(const Codes& codes) const;

    /// Adds the changes to the weights. Throws ValueError unless `model` is the one that they were
    /// made for.
    void apply(Model& model) const;
    /// A decoder with the weights of `model` and these changes. Throws what `apply` throws.
    [[nodiscard]] Model applied_to(const Model& model) const;

    /// The differences of the changed parameters, by name.
    [[nodiscard]] const std::map<std::string, Tensor>& differences() const { return differences_; }

private:
    std::string model_;              ///< fingerprint of the weights before the changes
    std::vector<float> identity_{};  ///< of the face; empty: unknown
    std::map<std::string, Tensor> differences_;
};

/// A checksum over names and values of the decoder's parameters, which identifies a model.
[[nodiscard]] std::string decoder_fingerprint(const Model& model);

}  // namespace stymo
