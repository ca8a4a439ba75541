#include "nn/models/picture.h"

#include "core/kernels/elementwise.h"
#include "core/kernels/shape.h"

namespace stymo {

namespace {

Tensor item(const Tensor& batch, std::int64_t index) {
    return kernels::slice(batch, 0, index, index + 1).reshaped({batch.shape(1), batch.shape(2), batch.shape(3)});
}

}  // namespace

Tensor picture(const Tensor& images, std::int64_t index) {
    return kernels::clamp(kernels::affine(item(images, index), 0.5, 0.5), 0.0, 1.0);
}

Tensor picture_mask(const Tensor& masks, std::int64_t index) {
    return item(masks, index);
}

Tensor masked_picture(const Tensor& picture, const Tensor& mask) {
    return kernels::multiply(picture, mask);
}

}  // namespace stymo
