#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/optim/adam.h"
#include "support/golden.h"
#include "train/reconstruction_stage.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_agreement_vectors.py, which has the same sizes.
namespace {

struct AgreementCase {
    GoldenVectors vectors;
    Rng seed;
    DecoderConfig decoder;
    std::int64_t batch;
    std::int64_t samples;
    std::int64_t head_width;
    bool report;  ///< whether to print the errors
};

DecoderConfig decoder_config(std::int64_t resolution, std::int64_t width, std::int64_t layers, std::int64_t features,
                             std::int64_t frequencies, std::vector<std::int64_t> blocks, std::int64_t mask, std::int64_t mapping,
                             std::int64_t rays_per_side = 32) {
    DecoderConfig config;
    config.resolution = resolution;
    config.field_width = width;
    config.field_layers = layers;
    config.feature_channels = features;
    config.frequencies = frequencies;
    config.block_channels = std::move(blocks);
    config.mask_channels = mask;
    config.mapping_layers = mapping;
    config.rays.rays_per_side = rays_per_side;
    return config;
}

AgreementCase small_case(std::uint64_t seed, const DecoderConfig& decoder) {
    return {.vectors = {STYMO_SOURCE_DIR "/tests/golden/agreement_vectors.safetensors", true},
            .seed = Rng(seed),
            .decoder = decoder,
            .batch = 2,
            .samples = 5,
            .head_width = 8,
            .report = false};
}

/// The paper's decoder cut at 64 pixels.
AgreementCase full_case(const std::filesystem::path& folder) {
    return {.vectors = {folder / "agreement_vectors.safetensors", false},
            .seed = Rng(1),
            .decoder = decoder_config(64, 256, 8, 256, 10, {128}, 16, 4),
            .batch = 8,
            .samples = 8,
            .head_width = 512,
            .report = true};
}

/// (B, side, side, channels) in [-1, 1]
Tensor picture(const AgreementCase& agreement, const std::string& name, std::int64_t side, DType dtype,
               std::int64_t channels = 3) {
    Tensor values = golden_numbers(agreement.seed, name, {agreement.batch, side, side, channels});
    for (double& value : values.mutable_values<double>()) value = static_cast<float>(value / 1.75);
    return values.to(dtype);
}

Tensor mask(const AgreementCase& agreement, const std::string& name, std::int64_t side, DType dtype) {
    return affine(Variable(picture(agreement, name, side, DType::float64, 1)), 0.5, 0.5).value().to(dtype);
}

std::array<Tensor, 4> codes(const AgreementCase& agreement, const std::string& prefix, DType dtype) {
    std::array<Tensor, 4> result;
    for (std::size_t i = 0; i < result.size(); ++i)
        result[i] = golden_numbers(agreement.seed, prefix + "." + code_names[i], {agreement.batch, code_sizes[i]}).to(dtype);
    return result;
}

std::vector<Camera> cameras(const AgreementCase& agreement) {
    const Tensor numbers = golden_numbers(agreement.seed, "poses", {agreement.batch, 6});
    const std::span<const double> x = numbers.values<double>();
    std::vector<Camera> result;
    for (std::size_t i = 0; i < x.size(); i += 6) {
        const Vector3 center{0.5 * x[i + 3], 0.5 * x[i + 4], 0.125 * x[i + 5] + 5.25};
        result.push_back(camera_from_pose({0.25 * x[i], 0.125 * x[i + 1], 0.0625 * x[i + 2], center}, {}));
    }
    return result;
}

Tensors by_name(const std::vector<Parameter>& parameters, const std::vector<Variable>& gradients) {
    Tensors result;
    for (std::size_t i = 0; i < parameters.size(); ++i) result[parameters[i].name()] = gradients[i].value();
    return result;
}

Tensors values_of(const std::vector<Parameter>& parameters) {
    Tensors result;
    for (const Parameter& parameter : parameters) result[parameter.name()] = parameter.variable().value();
    return result;
}

void decoder_agrees(const AgreementCase& agreement, DType dtype) {
    Rng rng(1);
    ParameterStore store;
    const Decoder decoder(agreement.decoder, store, "decoder", rng);
    set_golden_parameters(store, agreement.seed, dtype);
    Codes z;
    const std::array<Tensor, 4> numbers = codes(agreement, "decoder.z", dtype);
    for (std::size_t i = 0; i < numbers.size(); ++i) z.groups[i] = Variable::leaf(numbers[i]);
    const Decoded decoded = decoder(z, cameras(agreement), {.samples_per_ray = agreement.samples, .mask = true});

    std::map<std::string, Variable> outputs{{"feature_map", decoded.feature_map}, {"mask_logit", decoded.mask_logit}};
    for (std::size_t i = 0; i < decoded.images.size(); ++i) outputs["image" + std::to_string(i)] = decoded.images[i];
    Tensors values;
    Variable loss;
    for (const auto& [name, output] : outputs) {
        values[name] = output.value();
        const Variable term = mean(square(output));
        loss = loss.defined() ? loss + term : term;
    }
    agreement.vectors.check("decoder/output", values, agreement.report);

    std::vector<Variable> leaves;
    for (const Parameter& parameter : store.all()) leaves.push_back(parameter.variable());
    leaves.insert(leaves.end(), z.groups.begin(), z.groups.end());
    const std::vector<Variable> gradients = grad(loss, leaves);
    Tensors named = by_name(store.all(), gradients);
    for (std::size_t i = 0; i < z.groups.size(); ++i)
        named[std::string("z.") + code_names[i]] = gradients[store.all().size() + i].value();
    agreement.vectors.check("decoder/gradient", named, agreement.report);
}

TrainConfig stage_config(const AgreementCase& agreement) {
    TrainConfig config;
    config.model.decoder = agreement.decoder;
    config.model.encoder.backbone = "small_conv";
    config.model.encoder.head_width = agreement.head_width;
    config.model.reconstruction.resolution_weights = {0.7};
    config.loss.opacity_weight = 0.2;
    config.loss.depth_variance_weight = 0.3;
    config.loss.code_norm_weight = 0.1;
    config.stage1.samples_per_ray = agreement.samples;
    return config;
}

TrainingBatch stage1_batch(const AgreementCase& agreement, DType dtype) {
    TrainingBatch batch;
    batch.input = picture(agreement, "stage1.input", 64, dtype);
    batch.targets = {picture(agreement, "stage1.target0", 64, dtype)};
    batch.mask = mask(agreement, "stage1.mask", 64, dtype);
    batch.mask_32 = mask(agreement, "stage1.mask_32", 32, dtype);
    batch.cameras = cameras(agreement);
    batch.codes = codes(agreement, "stage1.code", dtype);
    Tensor present({agreement.batch}, DType::float64);
    double last = 0.0;
    for (double& value : present.mutable_values<double>()) value = last = 1.0 - last;
    batch.code_present = present.to(dtype);
    return batch;
}

Tensors terms(const LossTerms& losses, DType dtype) {
    Tensors result;
    for (const auto& [name, value] : std::initializer_list<std::pair<const char*, double>>{
             {"total", losses.total},
             {"reconstruction", losses.reconstruction},
             {"code", losses.code},
             {"mask", losses.mask},
             {"opacity", losses.opacity},
             {"depth_variance", losses.depth_variance},
             {"code_norm", losses.code_norm}})
        result[name] = Tensor::scalar(value, dtype);
    return result;
}

void stage1_agrees(const AgreementCase& agreement, DType dtype) {
    const TrainConfig config = stage_config(agreement);
    Rng rng(1);
    Model model(config.model, rng);
    set_golden_parameters(model.parameters(), agreement.seed, dtype);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    Rng jitter = agreement.seed.split("stage1.jitter");
    const LossAndGradients result = reconstruction_gradients(model, stage1_batch(agreement, dtype), config, parameters, true, jitter);
    agreement.vectors.check("stage1/loss", terms(result.losses, dtype), agreement.report);
    agreement.vectors.check("stage1/gradient", by_name(parameters, result.gradients), agreement.report);
    Adam({config.optimizer.beta1, config.optimizer.beta2, config.optimizer.epsilon})
        .step(parameters, result.gradients, config.optimizer.learning_rate);
    agreement.vectors.check("stage1/stepped", values_of(parameters), agreement.report);
}

}  // namespace

TEST_CASE("a tiny decoder with its rays, images and mask, and all its gradients agree with PyTorch", "[agreement]") {
    for (const DType dtype : {DType::float64, DType::float32}) decoder_agrees(small_case(9, decoder_config(16, 8, 4, 6, 2, {5, 4}, 3, 2, 4)), dtype);
}

TEST_CASE("a first-stage step of a tiny model agrees with PyTorch", "[agreement]") {
    for (const DType dtype : {DType::float64, DType::float32}) stage1_agrees(small_case(11, decoder_config(64, 8, 2, 8, 3, {6}, 2, 2)), dtype);
}

TEST_CASE("the paper's decoder at 64 pixels and all its gradients agree with PyTorch", "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32}) decoder_agrees(full_case(*folder), dtype);
}

TEST_CASE("a first-stage step at the paper's width agrees with PyTorch", "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32}) stage1_agrees(full_case(*folder), dtype);
}
