#pragma once

#include <filesystem>
#include <vector>

#include "apps/eval/evaluate.h"
#include "apps/eval/score.h"
#include "nn/models/identity_network.h"

namespace stymo {

/// Measures whether a fitted face shows the same person as its photo, also from the side: cosines
/// between embeddings of a face recognition network.
class IdentityMeasure {
public:
    /// `weights` are those of MobileFaceNet, from `stymo-weights import`. Throws FileError for a
    /// file that cannot be used.
    explicit IdentityMeasure(const std::filesystem::path& weights) : network_(weights) {}

    /// The score of the fitted codes of `fit`. `other` is a photo of another person.
    [[nodiscard]] IdentityScore measure(const Model& model, const ComparedFace& face,
                                        const ComparedFace& other, const FitResult& fit) const;

    /// The embedding, of unit length, of an image (S, S, 3) in [0, 1] with the head on black in
    /// FFHQ's frame.
    [[nodiscard]] std::vector<double> embedding(const Tensor& image) const;

private:
    IdentityNetwork network_;
};

}  // namespace stymo
