#include "nn/layers/plain_render_block.h"

#include <numbers>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/blur_upsampled.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"

namespace stymo {
namespace {

LinearOptions leaky_without_gain() {
    return {.activation = Activation::leaky_relu, .gain = 1.0 / std::numbers::sqrt2};
}

}  // namespace

PlainRenderBlock::PlainRenderBlock(ParameterStore& store, const std::string& prefix,
                                   std::int64_t in, std::int64_t out, bool first, Rng& rng)
    : widened_(store, prefix + ".widened", in, 2 * in, leaky_without_gain(), rng),
      detail_(store, prefix + ".detail", 2 * in, 4 * in, leaky_without_gain(), rng),
      narrowed_(store, prefix + ".narrowed", in, out, {.activation = Activation::leaky_relu}, rng),
      to_rgb_(store, prefix + ".to_rgb", out, 3, {}, rng) {
    if (first) to_rgb_below_.emplace(store, prefix + ".to_rgb_below", in, 3, LinearOptions{}, rng);
}

Variable PlainRenderBlock::features(const Variable& below) const {
    return narrowed_(blur_upsampled(below, detail_.by_group(widened_(below), 4)));
}

FoldedRenderBlock PlainRenderBlock::folded(const Variable&) const {
    fail<ValueError>(
        "the fast renderer needs modulated render blocks, decoder.conditioning = modulation");
}

std::int64_t PlainRenderBlock::multiply_adds() const {
    return widened_.multiply_adds() + detail_.multiply_adds() +
           4 * (narrowed_.multiply_adds() + to_rgb_.multiply_adds()) +
           (to_rgb_below_ ? to_rgb_below_->multiply_adds() : 0);
}

UpsampleWidths PlainRenderBlock::widths() const {
    return {narrowed_.inputs(), narrowed_.outputs(),
            detail_.inputs() + detail_.outputs() + 4 * narrowed_.inputs()};
}

Rendered PlainRenderBlock::operator()(const Rendered& below, const Variable&,
                                      bool recomputed) const {
    const Variable rgb_below = to_rgb_below_ ? (*to_rgb_below_)(below.features) : below.rgb;
    std::vector<Variable> images;
    for (std::int64_t image = 0; recomputed && image < below.features.shape(0); ++image) {
        images.push_back(recompute(
            [block = *this](std::span<const Variable> inputs) { return block.features(inputs[0]); },
            {slice(below.features, 0, image, image + 1)}));
    }
    const Variable above = recomputed ? concat(images, 0) : features(below.features);
    return {above, to_rgb_(above) + upsample_smoothly(rgb_below)};
}

}  // namespace stymo
