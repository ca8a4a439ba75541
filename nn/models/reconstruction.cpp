#include "nn/models/reconstruction.h"

#include <algorithm>
#include <bit>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "nn/known_pixels.h"
#include "nn/losses.h"
#include "nn/pretrained/perceptual/feature_distance.h"

namespace stymo {

EncoderDistance::EncoderDistance(const Encoder& encoder) : backbone_(encoder.backbone()) {
    if (!backbone_.has_activations())
        fail<ConfigError>(
            "reconstruction.perceptual_network = encoder needs encoder.backbone = small_conv "
            "or small_residual");
}

EncoderDistance::Features EncoderDistance::features(const Variable& images) const {
    Features features;
    for (const Variable& activation : backbone_.activations(images))
        features.push_back(unit_channels(activation, feature_epsilon));
    return features;
}

Variable EncoderDistance::distance_to(const Variable& images, const Features& target) const {
    const std::vector<Variable> activations = backbone_.activations(images);
    if (target.size() != activations.size())
        fail<ShapeError>("the encoder compares ", activations.size(), " features, got ",
                         target.size());
    Variable total;
    for (std::size_t i = 0; i < activations.size(); ++i) {
        const Tensor ones = Tensor::full({activations[i].shape(3)}, 1.0, activations[i].dtype());
        const Variable term = feature_distance(activations[i], target[i].value(), ones);
        total = total.defined() ? total + term : term;
    }
    return total / static_cast<double>(activations.size());
}

LayerMemory EncoderDistance::memory(std::int64_t side) const {
    // Two copies of the activations; most of them belong to the first layer.
    constexpr std::int64_t per_pixel = 64;
    return {0, per_pixel * side * side};
}

ReconstructionLoss::ReconstructionLoss(const ReconstructionConfig& config,
                                       const std::string& off_switch, const Encoder* encoder)
    : config_(config) {
    const std::int64_t side = config.perceptual_resolution;
    if (side < 0 || (side > 0 && !std::has_single_bit(static_cast<std::uint64_t>(side))))
        fail<ConfigError>("reconstruction.perceptual_resolution = ", side,
                          " is no power of two; 0 stands for no limit");
    if (config.perceptual_weight <= 0.0) return;
    if (config.perceptual.network != encoder_network) {
        lpips_.emplace(config.perceptual, off_switch);
    } else if (encoder != nullptr) {
        encoder_distance_.emplace(*encoder);
    } else {
        fail<ConfigError>(
            "reconstruction.perceptual_network = encoder serves fitting alone; training needs a "
            "network of LPIPS, or ",
            off_switch);
    }
}

const PerceptualDistance* ReconstructionLoss::network() const {
    if (encoder_distance_) return &*encoder_distance_;
    return lpips();
}

ReconstructionLoss::Target ReconstructionLoss::target(std::span<const Tensor> images,
                                                      std::int64_t resolution,
                                                      const Tensor& known) const {
    Target target;
    for (const Tensor& image : images) {
        if (resolution > 0 && image.shape(1) > resolution) continue;
        target.images.push_back(image);
        if (known.defined())
            target.known.push_back(known_at(known, image.shape(1), image.shape(2)));
    }
    target.weights = config_.resolution_weights;
    return target;
}

namespace {

/// Image i at the size at which LPIPS compares it.
Variable compared_image(const Variable& images, std::int64_t i, std::int64_t largest_side) {
    const Variable image = slice(images, 0, i, i + 1);
    if (largest_side == 0 || image.shape(1) <= largest_side) return image;
    return resize_box(image, static_cast<int>(largest_side), static_cast<int>(largest_side));
}

/// Mean of the perceptual distance over the batch. Each image's gradient is computed before the
/// features of the next image, since features of large images dominate the memory.
Variable perceptual_loss(const PerceptualDistance& perceptual, const Variable& images,
                         const Tensor& photos, const ReconstructionLoss::Target& target,
                         std::int64_t largest_side) {
    Variable total;
    for (std::int64_t i = 0; i < images.shape(0); ++i) {
        const PerceptualDistance::Features features =
            target.features.empty() ? perceptual.features(compared_image(photos, i, largest_side))
                                    : target.features.at(static_cast<std::size_t>(i));
        const auto distance = [&](const Variable& image) {
            return sum(perceptual.distance_to(image, features));
        };
        const Variable one =
            differentiate_at_once(distance, compared_image(images, i, largest_side));
        total = total.defined() ? total + one : one;
    }
    return total / static_cast<double>(images.shape(0));
}

}  // namespace

ReconstructionLoss::Target ReconstructionLoss::kept_target(std::span<const Tensor> images,
                                                           const Tensor& known) const {
    Target kept = target(images, 0, known);
    if (network() == nullptr || kept.images.empty() || known.defined()) return kept;
    for (std::int64_t i = 0; i < kept.images.back().shape(0); ++i)
        kept.features.push_back(network()->features(
            compared_image(kept.images.back(), i, config_.perceptual_resolution)));
    return kept;
}

LayerMemory ReconstructionLoss::memory(std::int64_t side) const {
    const std::int64_t limit = config_.perceptual_resolution;
    if (network() == nullptr) return {};
    return network()->memory(limit > 0 ? std::min(limit, side) : side);
}

double ReconstructionLoss::perceptual_weight() const {
    return network() == nullptr ? 0.0 : config_.perceptual_weight;
}

Variable ReconstructionLoss::photometric(const std::vector<Variable>& images,
                                         const Target& target) const {
    std::vector<Tensor> photos = target.images;
    for (std::size_t i = 0; i < std::min(images.size(), target.known.size()); ++i)
        photos[i] = where_known(target.known[i], photos[i], images[i].detach()).value();
    return photometric_loss(images, photos, target.weights);
}

Variable ReconstructionLoss::perceptual(const std::vector<Variable>& images,
                                        const Target& target) const {
    Tensor photo = target.images.at(images.size() - 1);
    Variable seen = images.back();
    if (!target.known.empty()) {
        // Known pixels beside unknown ones must not move those.
        const Tensor& known = target.known.at(images.size() - 1);
        photo = where_known(known, photo, images.back().detach()).value();
        seen = where_known(known, seen, images.back().detach());
    }
    return perceptual_loss(*network(), seen, photo, target, config_.perceptual_resolution);
}

ReconstructionLoss::Terms ReconstructionLoss::operator()(const std::vector<Variable>& images,
                                                         const Target& target) const {
    Terms terms;
    terms.photometric = photometric(images, target);
    work::count_named("loss_terms", "photometric", 1);
    terms.total = terms.photometric * photometric_weight();
    if (perceptual_weight() > 0.0) {
        terms.perceptual = perceptual(images, target);
        work::count_named("loss_terms", "perceptual", 1);
        terms.total = terms.total + terms.perceptual * perceptual_weight();
    }
    return terms;
}

}  // namespace stymo
