#include "train/agreement_case.h"

#include <cmath>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"

namespace stymo::test {
namespace {

/// He's deviation for the trunk, which is used as stored, and heads that are not negative.
void set_perceptual_parameters(ParameterStore& store, const Rng& seed, DType dtype) {
    store.convert(DType::float64);
    for (const Parameter& parameter : store.all()) {
        const Shape& shape = parameter.variable().shape();
        const std::string name = parameter.name().substr(std::string("lpips.").size());
        Tensor values = golden_numbers(name, shape, seed);
        const bool head = name.starts_with("heads.");
        const double scale =
            shape.rank() == 4 ? std::sqrt(2.0 / static_cast<double>(shape.product(1, 4))) : 0.25;
        for (double& value : values.mutable_values<double>())
            value = head ? std::abs(value) : static_cast<double>(static_cast<float>(value * scale));
        parameter.set_value(values);
    }
    store.convert(dtype);
}

}  // namespace

TrainConfig AgreementCase::config() const {
    TrainConfig config;
    config.model.decoder = decoder;
    config.model.encoder.backbone = "small_conv";
    config.model.encoder.head_width = head_width;
    ReconstructionConfig& reconstruction = config.model.reconstruction;
    reconstruction.resolution_weights = {0.3, 0.7};
    reconstruction.perceptual_weight = perceptual.empty() ? 0.0 : 0.1;
    reconstruction.perceptual = {.network = perceptual, .trunk = "random", .heads = "random"};
    config.loss.opacity_weight = 0.2;
    config.loss.depth_variance_weight = 0.3;
    config.loss.code_norm_weight = 0.1;
    config.stage1.samples_per_ray = samples;
    config.discriminator.max_channels = 8;
    return config;
}

Model AgreementCase::model(DType dtype) const {
    Rng unused(1);
    Model model(config().model, unused);
    set_golden_parameters(model.parameters(), dtype, seed);
    return model;
}

ReconstructionLoss AgreementCase::reconstruction(DType dtype) const {
    ReconstructionLoss loss(config().model.reconstruction);
    if (loss.lpips() != nullptr) set_perceptual_parameters(loss.lpips()->parameters(), seed, dtype);
    return loss;
}

Tensor AgreementCase::image(const std::string& image_name, std::int64_t side, std::int64_t channels,
                            DType dtype) const {
    Tensor values = golden_numbers(image_name, {batch, side, side, channels}, seed);
    for (double& value : values.mutable_values<double>()) value = static_cast<float>(value / 1.75);
    return values.to(dtype);
}

Tensor AgreementCase::mask(std::int64_t side, DType dtype) const {
    return affine(Variable(image("mask" + std::to_string(side), side, 1, DType::float64)), 0.5, 0.5)
        .value()
        .to(dtype);
}

FaceBatch AgreementCase::training_batch(DType dtype) const {
    FaceBatch result;
    result.input = image("input", 64, 3, dtype);
    for (std::int64_t side = 2 * decoder.rays.rays_per_side; side <= decoder.resolution; side *= 2)
        result.targets.push_back(image("target" + std::to_string(side), side, 3, dtype));
    result.mask = mask(decoder.resolution, dtype);
    result.ray_mask = mask(decoder.rays.rays_per_side, dtype);
    result.cameras = cameras();
    result.codes = codes("code", dtype);
    Tensor present({batch}, DType::float64);
    double last = 0.0;
    for (double& value : present.mutable_values<double>()) value = last = 1.0 - last;
    result.code_present = present.to(dtype);
    return result;
}

std::vector<Camera> AgreementCase::cameras() const {
    const Tensor numbers = golden_numbers("poses", {batch, 6}, seed);
    const std::span<const double> x = numbers.values<double>();
    std::vector<Camera> result;
    for (std::size_t i = 0; i < x.size(); i += 6) {
        const Eigen::Vector3d center{0.5 * x[i + 3], 0.5 * x[i + 4], 0.125 * x[i + 5] + 5.25};
        result.push_back(
            camera_from_pose({0.25 * x[i], 0.125 * x[i + 1], 0.0625 * x[i + 2], center}, {}));
    }
    return result;
}

std::array<Tensor, 4> AgreementCase::codes(const std::string& prefix, DType dtype) const {
    std::array<Tensor, 4> result;
    for (std::size_t i = 0; i < result.size(); ++i)
        result[i] =
            golden_numbers(prefix + "." + code_names[i], {batch, code_sizes[i]}, seed).to(dtype);
    return result;
}

DecoderConfig decoder_config(const DecoderSize& size) {
    DecoderConfig config;
    config.resolution = size.resolution;
    config.field_width = size.field_width;
    config.field_layers = size.field_layers;
    config.feature_channels = size.feature_channels;
    config.frequencies = size.frequencies;
    config.block_channels = size.block_channels;
    config.mask_channels = size.mask_channels;
    config.mapping_layers = size.mapping_layers;
    config.rays.rays_per_side = size.rays_per_side;
    return config;
}

AgreementCase small_agreement(const std::string& name, std::uint64_t seed, const DecoderSize& size,
                              const std::string& perceptual) {
    return {.name = name,
            .vectors = {STYMO_SOURCE_DIR "/tests/golden/agreement_vectors.safetensors", true},
            .seed = Rng(seed),
            .decoder = decoder_config(size),
            .perceptual = perceptual};
}

AgreementCase baseline_agreement(const std::string& name, const std::string& render) {
    AgreementCase agreement{
        .name = name,
        .vectors = {STYMO_SOURCE_DIR "/tests/golden/baseline_vectors.safetensors", true},
        .seed = Rng(1),
        .decoder = decoder_config({16, 8, 4, 6, 2, {5, 4}, 3, 0, 4})};
    agreement.decoder.conditioning = "concatenation";
    agreement.decoder.render = render;
    return agreement;
}

AgreementCase full_agreement(const std::string& name, const std::filesystem::path& folder,
                             DType dtype) {
    const char* file =
        dtype == DType::float64 ? "agreement_float64.safetensors" : "agreement_float32.safetensors";
    return {.name = name,
            .vectors = {folder / file, false},
            .seed = Rng(1),
            .decoder = decoder_config({64, 256, 8, 256, 10, {128}, 16, 4, 32}),
            .batch = 8,
            .samples = 8,
            .head_width = 512,
            .perceptual = "vgg16",
            .report = true,
            .gradient_bound = 5e-4};
}

void decoder_agrees(const AgreementCase& agreement, DType dtype) {
    Rng unused(1);
    ParameterStore store;
    const Decoder decoder(agreement.decoder, store, "decoder", unused);
    set_golden_parameters(store, dtype, agreement.seed);
    Codes z;
    const std::array<Tensor, 4> codes = agreement.codes("z", dtype);
    for (std::size_t i = 0; i < codes.size(); ++i) z.groups[i] = Variable::leaf(codes[i]);
    const Decoded decoded =
        decoder(z, agreement.cameras(), {.samples_per_ray = agreement.samples, .mask = true});

    std::map<std::string, Variable> outputs{{"feature_map", decoded.feature_map},
                                            {"mask_logit", decoded.mask_logit}};
    for (std::size_t i = 0; i < decoded.images.size(); ++i)
        outputs["image" + std::to_string(i)] = decoded.images[i];
    Tensors values;
    Variable loss = Tensor::zeros({}, dtype);
    for (const auto& [name, output] : outputs) {
        values[name] = output.value();
        loss = loss + mean(square(output));
    }
    agreement.check("output", values);

    std::vector<Variable> leaves = variables_of(store.all());
    leaves.insert(leaves.end(), z.groups.begin(), z.groups.end());
    const std::vector<Variable> gradients = grad(loss, leaves);
    Tensors named = gradients_of(store.all(), gradients);
    for (std::size_t i = 0; i < z.groups.size(); ++i)
        named[std::string("z.") + code_names[i]] = gradients[store.all().size() + i].value();
    agreement.check("gradient", named);
}

Tensors values_of(const std::vector<Parameter>& parameters) {
    Tensors result;
    for (const Parameter& parameter : parameters)
        result[parameter.name()] = parameter.variable().value();
    return result;
}

Tensors gradients_of(const std::vector<Parameter>& parameters,
                     const std::vector<Variable>& gradients) {
    Tensors result;
    for (std::size_t i = 0; i < parameters.size(); ++i)
        result[parameters[i].name()] = gradients[i].value();
    return result;
}

Tensors common_terms(const LossValues& losses, DType dtype) {
    return {{"total", Tensor::scalar(losses.total, dtype)},
            {"photometric", Tensor::scalar(losses["photometric"], dtype)},
            {"perceptual", Tensor::scalar(losses["perceptual"], dtype)},
            {"mask", Tensor::scalar(losses["mask"], dtype)},
            {"opacity", Tensor::scalar(losses["opacity"], dtype)},
            {"depth_variance", Tensor::scalar(losses["depth_variance"], dtype)}};
}

}  // namespace stymo::test
