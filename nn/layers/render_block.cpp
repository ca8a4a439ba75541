#include "nn/layers/render_block.h"

#include <numbers>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Upsampler::Upsampler(ParameterStore& store, const std::string& prefix, std::int64_t channels,
                     Rng& rng)
    : detail_(store, prefix + ".detail", channels, 4 * channels,
              {.activation = Activation::leaky_relu, .gain = 1.0 / std::numbers::sqrt2}, rng) {}

Variable Upsampler::operator()(const Variable& x) const {
    if (x.rank() != 4)
        fail<ShapeError>("upsampler: expected an image (batch, height, width, channels), got ",
                         x.shape());
    return blur_upsampled(x, detail_.by_group(x, 4));
}

Variable upsample_smoothly(const Variable& image) {
    const auto twice = [&](int axis) { return static_cast<int>(2 * image.shape(axis)); };
    return blur(resize_bilinear(image, twice(1), twice(2)));
}

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
