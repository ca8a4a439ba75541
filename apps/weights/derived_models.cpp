#include "apps/weights/derived_models.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/error.h"
#include "core/io/tensor_file.h"
#include "nn/models/code_file.h"
#include "nn/models/model.h"

namespace stymo {

void publish_model(const std::filesystem::path& in, const std::filesystem::path& out) {
    const Model model = Model::load(in);
    ModelConfig config = model.config();
    config.encoder = without_weight_files(config.encoder);
    config.reconstruction.perceptual = {.network = encoder_network};
    // With this weight, fitted and tuned faces had the highest PSNR and SSIM.
    config.reconstruction.perceptual_weight =
        model.has_encoder() && model.encoder().backbone().has_activations() ? 1.0 : 0.0;
    TensorFile file = read_tensor_file(in);
    file.metadata[config_key] = to_json(config);
    file.metadata[mark_key] = model_mark(in);
    write_tensor_file(out, file, StoredElements::float16);
}

namespace {

constexpr std::uint64_t seed_of_new_channels = 1;

ModelConfig widened_config(const ModelConfig& narrow, std::span<const std::string> settings) {
    ModelConfig wide = narrow;
    ConfigSchema schema;
    describe(schema, wide);
    for (const std::string& setting : settings) schema.set(setting);
    return wide;
}

void require_wider(const ModelConfig& narrow, const ModelConfig& wide) {
    const DecoderConfig &from = narrow.decoder, &to = wide.decoder;
    if (from.conditioning != "modulation" || from.render != "blocks")
        fail<ValueError>("only a decoder with modulated layers and render blocks can be widened");
    ModelConfig same = wide;
    if (to.resolution > from.resolution) {
        same.decoder.resolution = from.resolution;
        same.reconstruction.resolution_weights = narrow.reconstruction.resolution_weights;
    }
    same.decoder.field_width = from.field_width;
    same.decoder.feature_channels = from.feature_channels;
    same.decoder.block_channels = from.block_channels;
    same.decoder.mask_channels = from.mask_channels;
    if (narrow.encoder.identity_backbone == no_backbone) {
        same.encoder.identity_backbone = no_backbone;
        same.encoder.identity_weights.clear();
    }
    if (narrow.encoder.backbone == "small_conv" && wide.encoder.backbone == "small_residual")
        same.encoder.backbone = narrow.encoder.backbone;
    if (!narrow.encoder.identity_from_both) same.encoder.identity_from_both = false;
    if (wide.encoder.corrections > 0) same.encoder.corrections = narrow.encoder.corrections;
    if (narrow.encoder.expression_backbone == no_backbone) {
        same.encoder.expression_backbone = no_backbone;
        same.encoder.expression_weights.clear();
    }
    if (to_json(same) != to_json(narrow))
        fail<ConfigError>(
            "widening changes decoder.field_width, .feature_channels, .block_channels and "
            ".mask_channels, enlarges decoder.resolution with "
            "reconstruction.resolution_weights, turns encoder.backbone from small_conv to "
            "small_residual, and adds encoder.identity_backbone, .identity_from_both, "
            ".expression_backbone and .corrections, only");
    const auto times = static_cast<std::uint64_t>(to.resolution / from.resolution);
    if (to.resolution % from.resolution != 0 || !std::has_single_bit(times))
        fail<ConfigError>("decoder.resolution ", to.resolution, ": widening doubles ",
                          from.resolution, ", once or several times");
    const std::size_t needed =
        resolution_ladder(from).count() + static_cast<std::size_t>(std::bit_width(times)) - 1;
    const std::size_t blocks = from.block_channels.size();
    const std::vector<double>&weights = narrow.reconstruction.resolution_weights,
          &wide_weights = wide.reconstruction.resolution_weights;
    if (to.block_channels.size() != std::max(blocks, needed) ||
        wide_weights.size() != std::max(weights.size(), needed))
        fail<ConfigError>(
            "widening needs ", std::max(blocks, needed), " numbers in decoder.block_channels and ",
            std::max(weights.size(), needed), " in reconstruction.resolution_weights");
    if (to.field_width < from.field_width || to.feature_channels < from.feature_channels ||
        to.mask_channels < from.mask_channels ||
        !std::ranges::equal(from.block_channels, std::span(to.block_channels).first(blocks),
                            std::ranges::less_equal{}))
        fail<ConfigError>("widening needs at least as many channels in every layer as before");
}

/// Whether an added parameter is zero, so that a new render block enlarges the image and the mask
/// of the block before, and that a new residual block passes on what it reads.
bool starts_as_zero(const std::string& name) {
    return name.find(".to_rgb.") != std::string::npos ||
           name.find(".mask.lateral") != std::string::npos ||
           (name.starts_with("encoder.backbone.residual") &&
            name.find(".second.") != std::string::npos);
}

/// Copies the narrow tensor into the leading part of the wide one. In old rows the new columns are
/// 0. Stored weights are divided by sqrt(columns) when used, so the old ones are rescaled.
Tensor embedded(const Tensor& narrow, const Tensor& wide) {
    if (narrow.shape() == wide.shape()) return narrow;
    Tensor result = wide;
    const std::span<const float> from = narrow.values<float>();
    const std::span<float> to = result.mutable_values<float>();
    if (narrow.rank() == 1) {
        std::ranges::copy(from, to.begin());
        return result;
    }
    const auto rows = static_cast<std::size_t>(narrow.shape(0));
    const std::size_t columns = from.size() / rows;
    const auto wide_columns = static_cast<std::size_t>(wide.shape(1));
    const auto scale = static_cast<float>(
        std::sqrt(static_cast<double>(wide_columns) / static_cast<double>(columns)));
    for (std::size_t row = 0; row < rows; ++row) {
        const std::span<float> target = to.subspan(row * wide_columns, wide_columns);
        std::ranges::fill(target, 0.0F);
        std::ranges::transform(from.subspan(row * columns, columns), target.begin(),
                               [scale](float weight) { return scale * weight; });
    }
    return result;
}

/// The file has the weights of the backbones that were there before.
void require_weights_of_added(const EncoderConfig& before, EncoderConfig after) {
    after.backbone_weights = random_backbone;
    if (after.identity_backbone == before.identity_backbone)
        after.identity_weights = random_backbone;
    if (after.expression_backbone == before.expression_backbone)
        after.expression_weights = random_backbone;
    require_backbone_weights(after);
}

}  // namespace

void widen_model(const std::filesystem::path& in, const std::filesystem::path& out,
                 std::span<const std::string> settings) {
    const Model narrow = Model::load(in);
    ModelConfig config = widened_config(narrow.config(), settings);
    require_wider(narrow.config(), config);
    const EncoderConfig& before = narrow.config().encoder;
    if (uses_encoder(config)) require_weights_of_added(before, config.encoder);
    const bool adds_identity = config.encoder.identity_backbone != before.identity_backbone;
    const bool adds_expression = config.encoder.expression_backbone != before.expression_backbone;
    Rng rng(seed_of_new_channels);
    const Model wide(config, rng);
    TensorFile file = read_tensor_file(in);
    for (const Parameter& parameter : wide.parameters().all()) {
        const Tensor& larger = parameter.variable().value();
        const auto [narrower, added] = file.tensors.try_emplace(parameter.name(), larger);
        const std::string& name = parameter.name();
        if ((adds_identity && name.starts_with("encoder.heads.id.")) ||
            (adds_expression && name.starts_with("encoder.heads.expr.")))
            narrower->second = larger;  // it reads another embedding now
        else if (!added)
            narrower->second = embedded(narrower->second, larger);
        else if (starts_as_zero(name))
            narrower->second = Tensor::zeros(larger.shape());
    }
    config.encoder = without_weight_files(config.encoder);
    file.metadata[config_key] = to_json(config);
    file.metadata[mark_key] = model_mark(in);
    write_tensor_file(out, file);
}

}  // namespace stymo
