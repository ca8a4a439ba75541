#include "nn/layers/mask_branch.h"

#include <numbers>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"

namespace stymo {

MaskBranch::MaskBranch(ParameterStore& store, const std::string& prefix,
                       std::span<const std::int64_t> channels, std::span<const std::string> names,
                       std::int64_t mask_channels, Rng& rng)
    : logit_(store, prefix + ".logit", mask_channels, 1, {}, rng) {
    if (channels.size() != names.size())
        fail<ValueError>("mask branch ", prefix, ": ", channels.size(), " channel counts for ",
                         names.size(), " names");
    const LinearOptions options{.activation = Activation::leaky_relu,
                                .gain = 1.0 / std::numbers::sqrt2};
    for (std::size_t i = 0; i < channels.size(); ++i)
        laterals_.emplace_back(store, prefix + ".lateral" + names[i], channels[i], mask_channels,
                               options, rng);
}

Variable MaskBranch::operator()(std::span<const Variable> features) const {
    if (features.empty() || features.size() > laterals_.size())
        fail<ShapeError>("mask branch: ", features.size(), " feature maps for ", laterals_.size(),
                         " laterals");
    Variable sum = laterals_[0](features[0]);
    for (std::size_t i = 1; i < features.size(); ++i) {
        const auto side = [&](int axis) { return static_cast<int>(features[i].shape(axis)); };
        sum = laterals_[i](features[i]) + resize_bilinear(sum, side(1), side(2));
    }
    return logit_(sum);
}

LayerMemory MaskBranch::memory(std::span<const std::int64_t> sides, std::int64_t images,
                               bool recomputed) const {
    std::int64_t saved = 0;
    for (const std::int64_t side : sides) saved += images * logit_.inputs() * side * side;
    const std::int64_t pixels = images * sides.back() * sides.back();
    const std::int64_t sum = pixels * logit_.inputs();
    const std::int64_t transient = 3 * sum + pixels * laterals_[sides.size() - 1].inputs();
    if (recomputed) return {0, saved + sum + transient};
    return {saved + sum, transient};
}

FoldedMaskBranch MaskBranch::folded() const {
    FoldedMaskBranch branch{{}, logit_.folded()};
    for (const Linear& lateral : laterals_) branch.laterals.push_back(lateral.folded());
    return branch;
}

}  // namespace stymo
