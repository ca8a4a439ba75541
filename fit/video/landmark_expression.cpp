#include "fit/video/landmark_expression.h"

#include "fit/morphable/morphable_fit.h"

namespace stymo {

LandmarkExpression::LandmarkExpression(const PhotoPreparation& preparation, const Model& model)
    : preparation_(preparation), plausible_(model, preparation.head()) {}

void LandmarkExpression::know(std::span<const FrameInWork> faces) {
    identity_.assign(MorphableHead::identity_size, 0.0F);
    for (const FrameInWork& work : faces)
        for (std::size_t i = 0; i < identity_.size(); ++i)
            identity_[i] += work.face.code[i] / static_cast<float>(faces.size());
}

void LandmarkExpression::see(std::span<FrameInWork> faces) const {
    std::vector<MorphableFitTarget> targets;
    for (const FrameInWork& work : faces) {
        targets.push_back(work.target);
        targets.back().identity = identity_;
    }
    const std::vector<MorphableFit> fits = fit_morphable(
        preparation_.head(), targets, preparation_.settings().intrinsics, {.pixels = false});
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Tensor shown =
            Tensor::from({1, MorphableHead::expression_size}, std::span(fits[i].expression));
        faces[i].frame.change = plausible_(shown);
    }
}

}  // namespace stymo
