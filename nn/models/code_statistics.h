#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/io/tensor_file.h"
#include "core/rng.h"
#include "nn/models/codes.h"

namespace stymo {

/// A normal distribution over all 306 elements of the codes in Z, fitted to many faces. New faces
/// are drawn from it. It includes the correlations between the groups, for example between identity
/// and expression.
class CodeStatistics {
public:
    /// Mean and covariance (divided by the number of faces minus one) of the rows of `codes`. There
    /// may be fewer faces than the 306 elements; samples then lie in the affine span of these
    /// faces. Throws ValueError for fewer than two faces, NumericError for codes that are not
    /// finite.
    [[nodiscard]] static CodeStatistics of(const Codes& codes);
    /// Reads what `save` wrote; nothing if the file has no statistics. Throws FileError, which
    /// names `source`, if a tensor is missing, has another shape or is not finite.
    [[nodiscard]] static std::optional<CodeStatistics> load(const TensorFile& file,
                                                            const std::string& source);
    /// Adds the tensors "codes.mean" (306), "codes.factor" (306, 306) and "codes.faces".
    void save(TensorFile& file) const;

    /// The number of faces that the statistics come from.
    [[nodiscard]] std::int64_t faces() const { return faces_; }
    /// (306), float32, groups in the order of `code_names`.
    [[nodiscard]] const Tensor& mean() const { return mean_; }
    /// (306, 306), float32: L, lower triangular, with L L^T the covariance.
    [[nodiscard]] const Tensor& factor() const { return factor_; }
    /// The codes of one new face: mean + truncation * L n, with n standard normal. A truncation of
    /// 1 draws from the distribution, 0 gives the mean. In between, faces are less varied and have
    /// fewer artefacts. Draws 306 normal numbers from `rng`. Throws ValueError for a truncation
    /// outside [0, 10].
    [[nodiscard]] Codes sample(Rng& rng, double truncation) const;

    /// Face number `index` of those that are drawn with this seed.
    [[nodiscard]] Codes new_face(std::uint64_t seed, std::uint64_t index, double truncation) const;

private:
    CodeStatistics(std::int64_t faces, Tensor mean, Tensor factor);

    std::int64_t faces_;
    Tensor mean_;
    Tensor factor_;
};

}  // namespace stymo
