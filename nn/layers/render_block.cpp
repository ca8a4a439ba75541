#include "nn/layers/render_block.h"

#include "core/autograd/recompute.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {

LayerMemory UpsampleBlock::memory(std::int64_t side, std::int64_t images, bool recomputed) const {
    const auto [in, out, saved] = widths();
    const std::int64_t pixels = side * side;
    const std::int64_t features = pixels * out;
    const std::int64_t between = pixels / 4 * saved;
    const std::int64_t largest = pixels * std::max(in, out);
    // RGB images of this block, with the values that the losses save for them.
    const std::int64_t colours = 5 * 3 * pixels;
    if (recomputed)
        return {images * (features + colours), between + 4 * largest + 3 * images * features / 2};
    return {images * (features + between + colours), 3 * images * largest};
}

RenderBlock::RenderBlock(ParameterStore& store, const std::string& prefix, std::int64_t in,
                         std::int64_t out, std::int64_t style_size, Rng& rng)
    : upsampler_(store, prefix + ".upsampler", in, rng),
      modulated0_(store, prefix + ".modulated0", in, out, style_size, Activation::leaky_relu, rng),
      modulated1_(store, prefix + ".modulated1", out, out, style_size, Activation::leaky_relu, rng),
      to_rgb_(store, prefix + ".to_rgb", out, 3, {}, rng) {}

Variable RenderBlock::features(const Variable& below, const Variable& style) const {
    return modulated1_(modulated0_(upsampler_(below), style), style);
}

Variable RenderBlock::recomputed_features(const Variable& below, const Variable& style) const {
    std::vector<Variable> images;
    for (std::int64_t image = 0; image < below.shape(0); ++image) {
        const Segment segment = [block = *this, image](std::span<const Variable> inputs) {
            return block.features(slice(inputs[0], 0, image, image + 1),
                                  slice(inputs[1], 0, image, image + 1));
        };
        images.push_back(recompute(segment, {below, style}));
    }
    return concat(images, 0);
}

FoldedRenderBlock RenderBlock::folded(const Variable& style) const {
    return {upsampler_.folded_detail(), modulated0_.folded(style), modulated1_.folded(style),
            to_rgb_.folded()};
}

std::int64_t RenderBlock::multiply_adds() const {
    return upsampler_.multiply_adds() + 4 * (modulated0_.multiply_adds() +
                                             modulated1_.multiply_adds() + to_rgb_.multiply_adds());
}

UpsampleWidths RenderBlock::widths() const {
    return {modulated0_.inputs(), modulated0_.outputs(),
            upsampler_.saved() + 4 * (modulated0_.inputs() + modulated1_.inputs())};
}

Rendered RenderBlock::operator()(const Rendered& below, const Variable& style,
                                 bool recomputed) const {
    const Variable above =
        recomputed ? recomputed_features(below.features, style) : features(below.features, style);
    const Variable rgb = to_rgb_(above);
    return {above, below.rgb.defined() ? rgb + upsample_smoothly(below.rgb) : rgb};
}

}  // namespace stymo
