#include "nn/models/reconstruction.h"

#include "core/error.h"
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
    if (lpips_ && !target.pictures.empty()) target.features = lpips_->features(target.pictures.back());
    return target;
}

ReconstructionLoss::Terms ReconstructionLoss::operator()(const std::vector<Variable>& images, const Target& target) const {
    Terms terms;
    terms.photometric = photometric_loss(images, target.pictures, config_.resolution_weights);
    terms.total = terms.photometric * config_.photometric_weight;
    if (lpips_) {
        terms.perceptual = mean(lpips_->distance(lpips_->features(images.back()), target.features));
        terms.total = terms.total + terms.perceptual * config_.perceptual_weight;
    }
    return terms;
}

}  // namespace stymo
