#include "nn/models/reconstruction.h"

#include "core/autograd/recompute.h"
#include "core/ops/ops.h"
#include "nn/losses.h"

namespace stymo {

ReconstructionLoss::ReconstructionLoss(const ReconstructionConfig& config, const std::string& off_switch) : config_(config) {
    if (config.perceptual_weight > 0.0) lpips_.emplace(config.perceptual, off_switch);
}

ReconstructionLoss::Target ReconstructionLoss::target(std::span<const Tensor> pictures, std::int64_t resolution) const {
    Target target;
    for (const Tensor& picture : pictures)
        if (resolution == 0 || picture.shape(1) <= resolution) target.pictures.push_back(picture);
    return target;
}

namespace {

Lpips::Features features_of(const Lpips& lpips, const Tensor& pictures, std::int64_t i) {
    return lpips.features(slice(pictures, 0, i, i + 1));
}

/// Mean of LPIPS over the batch. Each image's gradient is taken before the next one's features are made, since those of a large
/// picture take more memory than all else.
Variable perceptual_loss(const Lpips& lpips, const Variable& images, const ReconstructionLoss::Target& target) {
    Variable total;
    for (std::int64_t i = 0; i < images.shape(0); ++i) {
        const Lpips::Features features = target.features.empty() ? features_of(lpips, target.pictures.back(), i)
                                                                 : target.features.at(static_cast<std::size_t>(i));
        const auto distance = [&](const Variable& image) { return sum(lpips.distance_to(image, features)); };
        const Variable one = differentiate_at_once(distance, slice(images, 0, i, i + 1));
        total = total.defined() ? total + one : one;
    }
    return total / static_cast<double>(images.shape(0));
}

}  // namespace

ReconstructionLoss::Target ReconstructionLoss::kept_target(std::span<const Tensor> pictures) const {
    Target kept = target(pictures);
    if (!lpips_ || kept.pictures.empty()) return kept;
    for (std::int64_t i = 0; i < kept.pictures.back().shape(0); ++i)
        kept.features.push_back(features_of(*lpips_, kept.pictures.back(), i));
    return kept;
}

ReconstructionLoss::Terms ReconstructionLoss::operator()(const std::vector<Variable>& images, const Target& target) const {
    Terms terms;
    terms.photometric = photometric_loss(images, target.pictures, config_.resolution_weights);
    terms.total = terms.photometric * config_.photometric_weight;
    if (lpips_) {
        terms.perceptual = perceptual_loss(*lpips_, images.back(), target);
        terms.total = terms.total + terms.perceptual * config_.perceptual_weight;
    }
    return terms;
}

}  // namespace stymo
