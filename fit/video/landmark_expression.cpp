#include "fit/video/landmark_expression.h"

#include "core/ops/ops.h"
#include "fit/expression_prior.h"
#include "fit/morphable/morphable_fit.h"

namespace stymo {

namespace {

/// Fits the linear head to landmarks alone; `identity` as in MorphableFitTarget.
std::vector<MorphableFit> fits_of(const PhotoPreparation& preparation,
                                  std::span<const FrameInWork> faces,
                                  const std::vector<float>& identity) {
    std::vector<MorphableFitTarget> targets;
    for (const FrameInWork& face : faces) targets.push_back(face.target);
    for (MorphableFitTarget& target : targets) target.identity = identity;
    return fit_morphable(preparation.head(), targets, preparation.settings().intrinsics,
                         {.pixels = false});
}

}  // namespace

LandmarkExpression::LandmarkExpression(const PhotoPreparation& preparation, const Model& model)
    : preparation_(preparation), plausible_(plausible_changes(model, preparation.head())) {}

void LandmarkExpression::know(std::span<const FrameInWork> faces) {
    identity_.assign(MorphableHead::identity_size, 0.0F);
    for (const MorphableFit& fit : fits_of(preparation_, faces, {}))
        for (std::size_t i = 0; i < identity_.size(); ++i)
            identity_[i] += fit.identity[i] / static_cast<float>(faces.size());
}

void LandmarkExpression::see(std::span<FrameInWork> faces) const {
    const std::vector<MorphableFit> fits = fits_of(preparation_, faces, identity_);
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Tensor shown =
            Tensor::from({1, MorphableHead::expression_size}, std::span(fits[i].expression));
        faces[i].frame.change = plausible_.defined() ? matmul(shown, plausible_).value() : shown;
    }
}

}  // namespace stymo
