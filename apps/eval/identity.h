#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "apps/eval/evaluate.h"
#include "apps/eval/score.h"

namespace stymo {

/// Whether a fitted face is the same person as its photo, from all sides: cosines between
/// embeddings of a face recognition network.
class IdentityMeasure {
public:
    /// `weights`: of MobileFaceNet, from `stymo-weights import`. Throws FileError for a file that
    /// does not serve.
    explicit IdentityMeasure(const std::filesystem::path& weights);
    ~IdentityMeasure();
    IdentityMeasure(const IdentityMeasure&) = delete;
    IdentityMeasure& operator=(const IdentityMeasure&) = delete;

    /// Of the codes that `fit` ended with. `other`: another person's photo.
    [[nodiscard]] IdentityScore measure(const Model& model, const ComparedFace& face,
                                        const ComparedFace& other, const FitResult& fit) const;

    /// Of length 1, of an image (S, S, 3) in [0, 1], the head on black in FFHQ's frame.
    [[nodiscard]] std::vector<double> embedding(const Tensor& image) const;

private:
    struct Network;
    std::unique_ptr<Network> network_;
};

}  // namespace stymo
