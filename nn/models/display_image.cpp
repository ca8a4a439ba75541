#include "nn/models/display_image.h"

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {

namespace {

Tensor item(const Tensor& batch, std::int64_t index) {
    return slice(batch, 0, index, index + 1)
        .value()
        .reshaped({batch.shape(1), batch.shape(2), batch.shape(3)});
}

}  // namespace

void require_finite(const Tensor& rendered) {
    if (!rendered.all_finite())
        fail<NumericError>(
            "the rendered image is not finite: numbers of the model or of the codes are too large");
}

Tensor display_image(const Tensor& images, std::int64_t index) {
    const Tensor image = item(images, index);
    require_finite(image);
    return clamp(Variable(image) * 0.5 + 0.5, 0.0, 1.0).value();
}

Tensor display_mask(const Tensor& masks, std::int64_t index) {
    return item(masks, index);
}

Tensor masked_image(const Tensor& image, const Tensor& mask) {
    return (Variable(image) * mask).value();
}

}  // namespace stymo
