#include "nn/layers/render_block.h"

#include "core/autograd/recompute.h"
#include "core/ops/elementwise.h"

namespace stymo {

RenderBlock::RenderBlock(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out,
                         std::int64_t style_size, Rng& rng)
    : upsampler_(store, prefix + ".upsampler", in, rng),
      modulated0_(store, prefix + ".modulated0", in, out, style_size, Activation::leaky_relu, rng),
      modulated1_(store, prefix + ".modulated1", out, out, style_size, Activation::leaky_relu, rng),
      to_rgb_(store, prefix + ".to_rgb", out, 3, {}, rng) {}

Variable RenderBlock::features(const Variable& below, const Variable& style) const {
    return modulated1_(modulated0_(upsampler_(below), style), style);
}

Rendered RenderBlock::operator()(const Rendered& below, const Variable& style, bool recomputed) const {
    const Segment segment = [block = *this](std::span<const Variable> inputs) { return block.features(inputs[0], inputs[1]); };
    const Variable above = recomputed ? recompute(segment, {below.features, style}) : features(below.features, style);
    const Variable rgb = to_rgb_(above);
    return {above, below.rgb.defined() ? rgb + double_smoothly(below.rgb) : rgb};
}

}  // namespace stymo
