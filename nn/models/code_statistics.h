#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/io/tensor_file.h"
#include "core/rng.h"
#include "nn/models/codes.h"

namespace stymo {

/// The codes of many faces in Z as one normal distribution over all 306 elements, from which new
/// faces are drawn. What the groups have in common (an expression that goes with an identity) is
/// kept.
class CodeStatistics {
public:
    /// Mean and covariance (over the number of faces less one) of the rows of `codes`, of which
    /// there may be fewer than numbers in a code: samples then lie between these faces. Throws
    /// ValueError for less than two faces, NumericError for codes that are not finite.
    [[nodiscard]] static CodeStatistics of(const Codes& codes);
    /// What `save` wrote, or nothing if the file has no statistics. Throws FileError naming
    /// `source` for what does not fit.
    [[nodiscard]] static std::optional<CodeStatistics> load(const TensorFile& file,
                                                            const std::string& source);
    /// Adds the tensors "codes.mean" (306), "codes.factor" (306, 306) and "codes.faces".
    void save(TensorFile& file) const;

    /// How many faces they are of.
    [[nodiscard]] std::int64_t faces() const { return faces_; }
    /// (306), float32, groups in the order of `code_names`.
    [[nodiscard]] const Tensor& mean() const { return mean_; }
    /// (306, 306), float32: L, lower triangular, with L L^T the covariance.
    [[nodiscard]] const Tensor& factor() const { return factor_; }
    /// One face: mean + truncation * L n with n normal. 1 draws from the distribution, 0 gives the
    /// mean; between them faces are less varied and less often odd. Takes 306 normal numbers of
    /// `rng`.
    [[nodiscard]] Codes sample(Rng& rng, double truncation) const;

private:
    CodeStatistics(std::int64_t faces, Tensor mean, Tensor factor);

    std::int64_t faces_;
    Tensor mean_;
    Tensor factor_;
};

}  // namespace stymo
