#include "nn/adversarial.h"

#include <array>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {

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
