#include "nn/pretrained/head_mask_network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/ops.h"
#include "nn/pretrained/face_square.h"

namespace stymo {
namespace {

constexpr double mask_slope = 0.1;
/// Channels of the levels, which have 1/4, 1/8, 1/16 and 1/32 of the image's side.
constexpr std::array<std::int64_t, 4> mask_widths{32, 48, 96, 96};
/// Each position of the finest level has the pixels of a 4x4 block.
constexpr std::int64_t pixels_in_block = 16;
constexpr const char* prefix_in_file = "head_mask.";
constexpr const char* mask_format_key = "format";
constexpr const char* any_mask_format = "stymo head-mask network ";
constexpr const char* mask_format = "stymo head-mask network 1";

ConvLayer mask_layer(ParameterStore& store, const std::string& name, std::int64_t in,
                     std::int64_t out, ConvLayerOptions options, double deviation_factor,
                     Rng& rng) {
    const auto fan_in = static_cast<double>(options.kernel * options.kernel * in);
    options.initial_deviation = deviation_factor * std::sqrt(2.0 / fan_in);
    return {store, name, in, out, options, rng};
}

ConvLayerOptions mask_pointwise() {
    return {.kernel = 1, .padding = 0};
}

/// A residual layer begins close to the identity.
constexpr double mask_residual = 0.2;

Variable doubled(const Variable& x) {
    return resize_bilinear(x, static_cast<int>(2 * x.shape(1)), static_cast<int>(2 * x.shape(2)));
}

}  // namespace

HeadMaskNetwork::HeadMaskNetwork(ParameterStore& store, const std::string& prefix, Rng& rng)
    : stem_(mask_layer(store, prefix + "stem", 3 * pixels_in_block, mask_widths[0],
                       mask_pointwise(), 1.0, rng)),
      stem_mix_(mask_layer(store, prefix + "stem_mix", mask_widths[0], mask_widths[0], {},
                           mask_residual, rng)),
      answer_(mask_layer(store, prefix + "answer", mask_widths[0], pixels_in_block, {}, 0.1, rng)) {
    for (std::size_t level = 1; level < mask_widths.size(); ++level) {
        const std::string name = prefix + "down" + std::to_string(level);
        const std::int64_t in = mask_widths[level - 1], out = mask_widths[level];
        Descent descent{mask_layer(store, name, in, out, {.stride = 2}, 1.0, rng), {}};
        descent.pair.push_back(mask_layer(store, name + ".first", out, out, {}, 1.0, rng));
        descent.pair.push_back(
            mask_layer(store, name + ".second", out, out, {}, mask_residual, rng));
        descents_.push_back(std::move(descent));
    }
    for (std::size_t level = mask_widths.size() - 1; level > 0; --level) {
        const std::string name = prefix + "up" + std::to_string(level);
        const std::int64_t in = mask_widths[level], out = mask_widths[level - 1];
        ascents_.push_back({mask_layer(store, name, in, out, mask_pointwise(), 1.0, rng),
                            mask_layer(store, name + ".mix", out, out, {}, mask_residual, rng)});
    }
}

Variable HeadMaskNetwork::operator()(const Variable& images) const {
    if (images.rank() != 4 || images.shape(1) % side_divisor != 0 ||
        images.shape(2) % side_divisor != 0 || images.shape(3) != 3)
        fail<ShapeError>("[head mask] images are (batch, side, side, 3), the side a multiple of ",
                         side_divisor, "; got ", images.shape());
    Variable x = stem_(pixel_unshuffle(pixel_unshuffle(unit_contrast(images))), mask_slope);
    x = x + stem_mix_(x, mask_slope);
    std::vector<Variable> levels{x};
    for (const Descent& descent : descents_) {
        x = descent.down(x, mask_slope);
        x = x + descent.pair[1](descent.pair[0](x, mask_slope), mask_slope);
        levels.push_back(x);
    }
    for (std::size_t i = 0; i < ascents_.size(); ++i) {
        x = doubled(ascents_[i].lateral(x, mask_slope)) + levels[levels.size() - 2 - i];
        x = x + ascents_[i].mix(x, mask_slope);
    }
    return pixel_shuffle(pixel_shuffle(answer_(x)));
}

HeadMaskModel make_head_mask_model(Rng rng) {
    auto store = std::make_shared<ParameterStore>();
    HeadMaskNetwork network(*store, prefix_in_file, rng);
    return {std::move(store), std::move(network)};
}

HeadMaskModel read_head_mask_model(const std::filesystem::path& path) {
    const TensorFile file = read_tensor_file(path);
    const auto found = file.metadata.find(mask_format_key);
    if (found == file.metadata.end() || !found->second.starts_with(any_mask_format))
        fail<FileError>(path.string(), ": not a head-mask network of stymo");
    if (found->second != mask_format)
        fail<FileError>(path.string(), ": is a \"", found->second, "\", and this program reads \"",
                        mask_format, "\"; use the network that comes with this program");
    HeadMaskModel model = make_head_mask_model(Rng(0));
    model.store->load(file, path.string());
    model.store->set_trainable("", false);
    return model;
}

void write_head_mask_model(const std::filesystem::path& path, const HeadMaskModel& model) {
    TensorFile file;
    file.metadata[mask_format_key] = mask_format;
    model.store->save(file);
    write_tensor_file(path, file, StoredElements::float16);
}

Tensor head_probability(const HeadMaskModel& model, const Tensor& crop, std::int64_t side) {
    const Tensor image =
        clamp(resize_image(crop, static_cast<int>(side), static_cast<int>(side)), 0.0, 1.0).value();
    const std::vector<Variable> pair{reshape(image, {1, side, side, 3}),
                                     reshape(mirror_image(image), {1, side, side, 3})};
    const Tensor both = sigmoid(model.network(concat(pair, 0))).value();
    const auto values = both.values<float>();
    const auto half = static_cast<std::ptrdiff_t>(side * side);
    Tensor mask({side, side, 1}), mirrored({side, side, 1});
    std::copy_n(values.begin(), half, mask.mutable_values<float>().begin());
    std::copy_n(values.begin() + half, half, mirrored.mutable_values<float>().begin());
    const Tensor mean = ((Variable(mask) + Variable(mirror_image(mirrored))) * 0.5).value();
    return clamp(
               resize_image(mean, static_cast<int>(crop.shape(0)), static_cast<int>(crop.shape(1))),
               0.0, 1.0)
        .value();
}

Variable known_mask_loss(const Variable& logit, const Tensor& mask, const Tensor& known) {
    const Variable weight(known);
    const Variable entropy = binary_cross_entropy_with_logits(logit, mask) * weight;
    return sum(entropy) / (sum(weight) + 1e-6);
}

}  // namespace stymo
