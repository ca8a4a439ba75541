#include "nn/losses.h"

#include <algorithm>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/known_pixels.h"

namespace stymo {

namespace {

void require_same_shape(const char* loss, const Shape& prediction, const Shape& target) {
    if (!(prediction == target))
        fail<ShapeError>(loss, ": prediction ", prediction, " and target ", target,
                         " differ in shape");
}

}  // namespace

Variable photometric_loss(std::span<const Variable> images, std::span<const Tensor> targets,
                          std::span<const double> weights) {
    if (images.empty() || images.size() != targets.size() || images.size() > weights.size())
        fail<ShapeError>("photometric_loss: ", images.size(), " images, ", targets.size(),
                         " targets and ", weights.size(), " weights");
    Variable total;
    for (std::size_t i = 0; i < images.size(); ++i) {
        require_same_shape("photometric_loss", images[i].shape(), targets[i].shape());
        const Variable term = mean(abs(images[i] - Variable(targets[i]))) * weights[i];
        total = i == 0 ? term : total + term;
    }
    return total;
}

Variable code_loss(const Codes& z, const std::array<Tensor, 4>& targets,
                   std::span<const double, 4> weights, const Tensor& present) {
    const std::int64_t batch = z.batch();
    require_same_shape("code_loss, present faces", {batch}, present.shape());
    const Variable factor = present.reshaped({batch, 1});
    Variable total;
    for (std::size_t i = 0; i < targets.size(); ++i) {
        require_same_shape("code_loss", z.groups[i].shape(), targets[i].shape());
        // A missing target may hold any value, even NaN, so it is selected out rather than
        // multiplied by 0.
        const Tensor included = broadcast_to(factor, targets[i].shape()).value();
        const Variable difference = where(included, z.groups[i] - Variable(targets[i]),
                                          Tensor::zeros(targets[i].shape(), z.groups[i].dtype()));
        const Variable term = sum(square(difference)) * (weights[i] / static_cast<double>(batch));
        total = i == 0 ? term : total + term;
    }
    return total;
}

Variable mask_loss(const Variable& logit, const Tensor& mask, const Tensor& known) {
    require_same_shape("mask_loss", logit.shape(), mask.shape());
    return mean(where_known(known, binary_cross_entropy_with_logits(logit, mask), 0.0));
}

Variable opacity_loss(const Variable& transmittance, const Tensor& mask, const Tensor& known) {
    if (transmittance.value().size() != mask.size())
        fail<ShapeError>("opacity_loss: transmittance ", transmittance.shape(), " and mask ",
                         mask.shape(), " differ in size");
    constexpr double lift = 1e-3;
    const Variable inside = mask.reshaped(transmittance.shape());
    const Variable log_opaque = log(affine(transmittance, -1.0, 1.0) + lift);
    const Variable log_clear = log(transmittance + lift);
    const Variable terms = inside * log_opaque + affine(inside, -1.0, 1.0) * log_clear;
    if (!known.defined()) return negate(mean(terms));
    return negate(mean(where_known(known.reshaped(transmittance.shape()), terms, 0.0)));
}

Variable depth_loss(const Variable& depth, const Tensor& target, const Tensor& present) {
    const Shape& shape = depth.shape();
    if (target.size() != depth.value().size() || present.size() != target.size())
        fail<ShapeError>("depth_loss: depth ", shape, ", target ", target.shape(), " and present ",
                         present.shape(), " differ in size");
    const Tensor selected = present.reshaped(shape);
    const double count = std::max(1.0, sum(Variable(selected)).value().item());
    return sum(abs(depth - Variable(target.reshaped(shape))) * Variable(selected)) / count;
}

Variable masked_mean(const Variable& images, const Tensor& mask) {
    if (images.rank() != 4)
        fail<ShapeError>("masked_mean: expected images (B, H, W, C), got ", images.shape());
    require_same_shape("masked_mean", images.shape().with(3, 1), mask.shape());
    const Variable area = sum(Variable(mask), {1, 2});
    const Variable divisor = where(area.value(), area, Tensor::scalar(1.0, mask.dtype()));
    return sum(images * Variable(mask), {1, 2}) / divisor;
}

Variable generator_loss(const Variable& fake_logits) {
    return real_loss(fake_logits);
}

Variable real_loss(const Variable& real_logits) {
    return mean(softplus(-real_logits));
}

Variable fake_loss(const Variable& fake_logits) {
    return mean(softplus(fake_logits));
}

Variable r1_penalty(const std::function<Variable(const Variable&)>& discriminator,
                    const Tensor& real_images) {
    const Variable images = Variable::leaf(real_images);
    // The gradient of the sum of logits gives each image the gradient of its own logit. Only the
    // minibatch deviation adds contributions of other images.
    const Variable gradient =
        grad(sum(discriminator(images)), images, {.create_graph = true, .dL_dy = {}});
    return sum(square(gradient)) * (0.5 / static_cast<double>(real_images.shape(0)));
}

Variable faded_image(const Variable& images, double fade) {
    if (!(fade >= 0.0 && fade <= 1.0))
        fail<ValueError>("an image's fade must be in [0, 1], got ", fade);
    if (fade == 1.0) return images;
    if (images.rank() != 4)
        fail<ShapeError>("faded_image: expected images (batch, height, width, channels), got ",
                         images.shape());
    const auto half = [&](int axis) { return static_cast<int>(images.shape(axis) / 2); };
    constexpr std::array<double, 2> repeat{1.0, 1.0};
    const Variable coarse = upfirdn2d(resize_box(images, half(1), half(2)), repeat, 2, 1, 1, 0);
    return coarse * (1.0 - fade) + images * fade;
}

}  // namespace stymo
