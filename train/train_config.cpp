#include "train/train_config.h"

#include <algorithm>

#include "core/error.h"

namespace stymo {

namespace {

void describe_loss(ConfigSchema& schema, LossConfig& config) {
    schema.numbers(
        "loss.code_weights", config.code_weights, 0.0, 1e6,
        "lambda of the code loss for id, expr, tex, light (paper: 0.001, 0.1, 0.001, 0.01)");
    schema.number(
        "loss.mask_weight", config.mask_weight, 0.0, 1e6,
        "lambda of the mask loss (paper: 0.01), in phases with images of decoder.resolution");
    schema.integer(
        "loss.mask_start_epoch", config.mask_start_epoch, 0, 1'000'000,
        "the mask loss is on from this epoch at the latest (paper: once training is stable)");
    schema.number(
        "loss.mask_start_improvement", config.mask_start_improvement, 0.0, 1.0,
        "start the mask loss earlier, once an epoch lowers the reconstruction loss of the "
        "two before by less than this fraction; 0: never");
    schema.number("loss.opacity_weight", config.opacity_weight, 0.0, 1e6,
                  "accumulated opacity against the mask (paper: none)");
    schema.number("loss.depth_variance_weight", config.depth_variance_weight, 0.0, 1e6,
                  "variance of the depth along each ray (paper: none)");
    schema.number(
        "loss.adversarial_weight", config.adversarial_weight, 0.0, 1e6,
        "lambda of the adversarial loss in stage 2 (paper: 0.1); 0: no discriminator is trained");
    schema.number("loss.code_norm_weight", config.code_norm_weight, 0.0, 1e6,
                  "mean squared number of the codes, learnt offsets included (paper: none)");
    schema.number("loss.identity_weight", config.identity_weight, 0.0, 1e6,
                  "1 - cosine between rendered face and photo in a face recognition network "
                  "(paper: none)");
    schema.number("loss.side_identity_weight", config.side_identity_weight, 0.0, 1e6,
                  "the same for half of the faces, rendered from half a radian to one side (paper: "
                  "none)");
    schema.text("loss.identity_network", config.identity_network,
                ".safetensors file with weights of MobileFaceNet (stymo-weights import) for "
                "both; random: only to try it");
    schema.number("loss.expression_weight", config.expression_weight, 0.0, 1e6,
                  "what half of the faces, drawn with the expressions of the others, fail to show "
                  "of them to encoder.expression_backbone (paper: none)");
}

void describe_optimizer(ConfigSchema& schema, OptimizerConfig& config) {
    schema.number("optimizer.learning_rate", config.learning_rate, 0.0, 1.0,
                  "Adam's learning rate in stage 1 (paper: 1e-4)");
    schema.choice(
        "optimizer.schedule", config.schedule, {"epoch", "cosine"},
        "epoch: times the decay after each (paper); cosine: to zero over the steps of stage 1");
    schema.number("optimizer.decay", config.decay, 0.0, 1.0,
                  "factor on the learning rate after each epoch (paper: 0.98)");
    schema.choice(
        "optimizer.matrices", config.matrices, {"adam", "muon", "muon_encoder"},
        "optimiser of weight matrices in stage 1 (paper: adam): muon for the decoder's, which "
        "learns faster, or muon_encoder for the encoder's too");
    schema.number("optimizer.beta1", config.beta1, 0.0, 0.999999, "Adam's decay of the mean");
    schema.number("optimizer.beta2", config.beta2, 0.0, 0.999999, "Adam's decay of the square");
    schema.number("optimizer.epsilon", config.epsilon, 1e-30, 1.0, "Adam's epsilon");
    schema.number("optimizer.backbone_factor", config.backbone_factor, 0.0, 100.0,
                  "factor on the learning rate of the encoder's backbone");
    schema.integer("optimizer.backbone_frozen_epochs", config.backbone_frozen_epochs, 0, 1'000'000,
                   "epochs in which the encoder's backbone stays as it is (paper: 1)");
    schema.number("optimizer.sample_tolerance", config.sample_tolerance, 0.0, 0.5,
                  "samples with a smaller compositing weight are skipped in the backward pass "
                  "(paper: 0, none is)");
    schema.integer("optimizer.failures_allowed", config.failures_allowed, 0, 1'000'000,
                   "consecutive steps that may be skipped because the loss or a gradient is not "
                   "finite");
}

void describe_stage1(ConfigSchema& schema, StageConfig& config) {
    schema.integer("stage1.steps", config.steps, 0, 100'000'000, "optimiser steps");
    schema.integer("stage1.batch", config.batch, 1, 65536,
                   "images in one optimiser step (paper: 32)");
    schema.integer(
        "stage1.micro_batch", config.micro_batch, 1, 65536,
        "images of one pass, computed by one thread where there are enough passes (paper: 8)");
    schema.integer("stage1.samples_per_ray", config.samples_per_ray, 2, 4096, "N (paper: 32)");
    schema.integer("stage1.resolution", config.resolution, 0, 1024,
                   "side of the largest image: 64, 128, ... trains the blocks up to it; 0: "
                   "decoder.resolution (paper)");
    schema.number("stage1.average_half_life", config.average_half_life, 0.0, 1e12,
                  "half life of the EMA of the weights, in images; 0: no EMA is kept");
    schema.boolean("stage1.decoder_frozen", config.decoder_frozen,
                   "the decoder stays as it is, and the encoder alone learns (paper: false)");
    schema.boolean("stage1.encoder_frozen", config.encoder_frozen,
                   "the encoder's backbone and heads stay as they are; its corrections "
                   "(encoder.corrections) still learn (paper: false)");
    schema.integer("stage1.pose_interval", config.pose_interval, 0, 1'000'000,
                   "every n-th step also learns offsets of the poses of its photos (paper: future "
                   "work); 0: no step does");
}

void describe_stage2(ConfigSchema& schema, AdversarialStageConfig& config) {
    schema.integers(
        "stage2.resolutions", config.resolutions, 64, 1024,
        "side of the images of each phase: 64, 128, ... up to decoder.resolution (paper); []: no "
        "second stage");
    schema.integers("stage2.images", config.images, 1, 1'000'000'000,
                    "number of images of each phase (paper: silent)");
    schema.integers(
        "stage2.fade_images", config.fade_images, 0, 1'000'000'000,
        "how many of these images fade in the discriminator's new block (paper: silent)");
    schema.integers("stage2.batch", config.batch, 1, 65536,
                    "images in one optimiser step (paper: 32, 32, 16, 12)");
    schema.integers("stage2.micro_batch", config.micro_batch, 1, 65536, "images of one pass");
    schema.numbers("stage2.r1_gamma", config.r1_gamma, 0.0, 1e6,
                   "weight of R1 (paper: silent; StyleGAN2 has 10 at 1024)");
    schema.integer(
        "stage2.r1_interval", config.r1_interval, 1, 1'000'000,
        "discriminator steps from one R1 step to the next (paper: silent; StyleGAN2 has 16)");
    schema.number("stage2.augmentation_target", config.augmentation_target, 0.0, 1.0,
                  "mean sign of the photos' logits above which the discriminator sees more images "
                  "changed at random (paper: silent; StyleGAN2-ADA has 0.6); 0: none is changed");
    schema.number("stage2.augmentation_images", config.augmentation_images, 1.0, 1e12,
                  "images that take the probability of a change from 0 to 1 (StyleGAN2-ADA has "
                  "500000)");
    schema.integer("stage2.samples_per_ray", config.samples_per_ray, 2, 4096, "N (paper: 64)");
    schema.number("stage2.learning_rate", config.learning_rate, 0.0, 1.0,
                  "Adam's learning rate of the decoder (paper: 2e-3)");
    schema.number("stage2.discriminator_learning_rate", config.discriminator_learning_rate, 0.0,
                  1.0, "Adam's learning rate of the discriminator (paper: 1e-4)");
    schema.number(
        "stage2.mapping_factor", config.mapping_factor, 0.0, 100.0,
        "factor on the learning rate of the mapping networks (paper: silent; StyleGAN2 has 0.01)");
    schema.number("stage2.beta1", config.beta1, 0.0, 0.999999,
                  "Adam's decay of the mean (paper: silent; StyleGAN2 has 0)");
    schema.number("stage2.beta2", config.beta2, 0.0, 0.999999,
                  "Adam's decay of the square (paper: silent; StyleGAN2 has 0.99)");
    schema.number("stage2.epsilon", config.epsilon, 1e-30, 1.0, "Adam's epsilon");
    schema.number(
        "stage2.average_half_life", config.average_half_life, 0.0, 1e12,
        "half life of the EMA of the weights, in images (paper: silent; StyleGAN2 has 10000); "
        "0: no EMA is kept");
}

void describe_output(ConfigSchema& schema, OutputConfig& config) {
    schema.integer("output.tick_steps", config.tick_steps, 1, 1'000'000,
                   "steps between two lines of statistics");
    schema.integer("output.sample_steps", config.sample_steps, 0, 100'000'000,
                   "steps between two sample sheets; 0: none");
    schema.number(
        "output.checkpoint_minutes", config.checkpoint_minutes, 0.0, 1e6,
        "minutes between two checkpoints; 0: only by steps, and at the end of each phase");
    schema.integer("output.checkpoint_steps", config.checkpoint_steps, 0, 100'000'000,
                   "steps between two checkpoints, beside those by minutes; 0: only by time");
    schema.integer("output.keep_last", config.keep_last, 1, 1'000'000, "checkpoints kept");
    schema.integer("output.validation_images", config.validation_images, 0, 1'000'000,
                   "held-out images that the best model is chosen by; 0: none is chosen");
    schema.integer("output.statistics_images", config.statistics_images, 0, 100'000'000,
                   "training images whose codes' mean and covariance the end of a run adds to its "
                   "model, for drawing new faces; 0: none");
}

std::string list_text(const std::vector<std::int64_t>& numbers) {
    std::string text;
    for (const std::int64_t number : numbers)
        text += (text.empty() ? "" : ", ") + std::to_string(number);
    return "[" + text + "]";
}

void check_group(const TrainConfig& config, std::size_t phase, const std::string& source) {
    const std::int64_t micro_batch = config.stage2.micro_batch[phase];
    const std::int64_t group = std::min(config.discriminator.group_size, micro_batch);
    if (config.loss.adversarial_weight > 0.0 && micro_batch % group != 0) {
        fail<ConfigError>(source, ": discriminator.group_size = ", group, " does not divide ",
                          micro_batch,
                          " of stage2.micro_batch = ", list_text(config.stage2.micro_batch));
    }
}

void check_stage2(const TrainConfig& config, const ResolutionLadder& ladder,
                  const std::string& source) {
    const AdversarialStageConfig& stage = config.stage2;
    if (stage.resolutions.empty()) return;
    constexpr std::int64_t first_side = 64;  // of the discriminator
    if (ladder.smallest() != first_side)
        fail<ConfigError>(source, ": decoder.rays_per_side = ", ladder.smallest() / 2,
                          ": the second stage begins with images of ", first_side,
                          " pixels, for which it must be ", first_side / 2);
    const std::vector<std::int64_t>& sides = ladder.sides();
    if (stage.resolutions != sides) {
        fail<ConfigError>(source, ": stage2.resolutions = ", list_text(stage.resolutions),
                          ": a model of ", config.model.decoder.resolution, " pixels needs ",
                          list_text(sides), ", or [] for no second stage");
    }
    const auto check_length = [&](const char* key, std::size_t length) {
        if (length != sides.size())
            fail<ConfigError>(source, ": stage2.", key, " has ", length,
                              " numbers, stage2.resolutions ", sides.size());
    };
    check_length("images", stage.images.size());
    check_length("fade_images", stage.fade_images.size());
    check_length("batch", stage.batch.size());
    check_length("micro_batch", stage.micro_batch.size());
    check_length("r1_gamma", stage.r1_gamma.size());
    for (std::size_t i = 0; i < sides.size(); ++i) {
        if (stage.batch[i] % stage.micro_batch[i] != 0) {
            fail<ConfigError>(source, ": stage2.micro_batch = ", list_text(stage.micro_batch),
                              " does not divide stage2.batch = ", list_text(stage.batch));
        }
        if (stage.fade_images[i] > stage.images[i]) {
            fail<ConfigError>(source, ": stage2.fade_images = ", list_text(stage.fade_images),
                              ": must not exceed stage2.images = ", list_text(stage.images));
        }
        check_group(config, i, source);
    }
    if (stage.fade_images.front() != 0) {
        fail<ConfigError>(source, ": stage2.fade_images = ", list_text(stage.fade_images),
                          ": must begin with 0; the first phase has nothing to fade from");
    }
}

ResolutionLadder checked_ladder(const TrainConfig& config, const std::string& source) {
    try {
        return resolution_ladder(config.model.decoder);
    } catch (const ConfigError& error) {
        fail<ConfigError>(source, ": ", error.what());
    }
}

void check_stage1(const TrainConfig& config, const ResolutionLadder& ladder,
                  const std::string& source) {
    const std::vector<std::int64_t>& sides = ladder.sides();
    const std::int64_t resolution = config.stage1.resolution;
    if (resolution != 0 && std::ranges::find(sides, resolution) == sides.end()) {
        fail<ConfigError>(source, ": stage1.resolution = ", resolution, ": a model of ",
                          config.model.decoder.resolution, " pixels renders ",
                          list_text(ladder.sides()), "; 0 stands for the largest");
    }
    if (config.stage1.batch % config.stage1.micro_batch != 0) {
        fail<ConfigError>(source, ": stage1.micro_batch = ", config.stage1.micro_batch,
                          " does not divide stage1.batch = ", config.stage1.batch);
    }
}

void check_encoder(const TrainConfig& config, const std::string& source) {
    const EncoderConfig& encoder = config.model.encoder;
    if (encoder.identity_from_both && encoder.identity_backbone == no_backbone)
        fail<ConfigError>(source, ": encoder.identity_from_both needs encoder.identity_backbone");
    if (config.stage1.decoder_frozen && config.optimizer.matrices == "muon")
        fail<ConfigError>(source,
                          ": optimizer.matrices = muon moves the decoder alone, which "
                          "stage1.decoder_frozen keeps; choose muon_encoder or adam");
    if (config.stage1.encoder_frozen && config.stage1.decoder_frozen && encoder.corrections == 0)
        fail<ConfigError>(source,
                          ": with stage1.encoder_frozen and stage1.decoder_frozen only "
                          "encoder.corrections learn; give some");
    if (uses_encoder(config.model)) return;
    const auto refuse = [&](bool given, const char* need) {
        if (given)
            fail<ConfigError>(source, ": codes.source = ", config.model.code_source, " needs ",
                              need);
    };
    refuse(config.data.mirror, "data.mirror = false: the code of a mirrored face is not known");
    refuse(config.data.other_photo > 0.0, "data.other_photo = 0: no encoder reads the other photo");
    refuse(config.data.turned_photos > 0.0, "data.turned_photos = 0: no encoder reads the photo");
    refuse(encoder.corrections > 0, "encoder.corrections = 0: an encoder's codes are corrected");
    refuse(config.stage1.decoder_frozen, "stage1.decoder_frozen = false: no encoder would learn");
}

void check_decoder(const DecoderConfig& decoder, double sample_tolerance,
                   const std::string& source) {
    if (sample_tolerance > 0.0 && decoder.conditioning == "concatenation")
        fail<ConfigError>(source,
                          ": optimizer.sample_tolerance needs decoder.conditioning = modulation");
    if (decoder.rays.near_z <= decoder.rays.far_z)
        fail<ConfigError>(source, ": decoder.near_z = ", decoder.rays.near_z,
                          ": must be above decoder.far_z = ", decoder.rays.far_z);
}

void check_losses(const TrainConfig& config, std::size_t resolutions, const std::string& source) {
    if (config.loss.compares_identity() && config.loss.identity_network.empty())
        fail<ConfigError>(source, ": ",
                          config.loss.identity_weight > 0.0 ? "loss.identity_weight"
                                                            : "loss.side_identity_weight",
                          " needs loss.identity_network");
    if (config.loss.expression_weight > 0.0 &&
        (!uses_encoder(config.model) || config.model.encoder.expression_backbone == no_backbone))
        fail<ConfigError>(source, ": loss.expression_weight needs encoder.expression_backbone");
    if (config.loss.expression_weight > 0.0 && config.stage1.micro_batch < 2)
        fail<ConfigError>(source, ": loss.expression_weight needs stage1.micro_batch >= 2");
    if (config.model.reconstruction.resolution_weights.size() < resolutions)
        fail<ConfigError>(source, ": reconstruction.resolution_weights has ",
                          config.model.reconstruction.resolution_weights.size(),
                          " numbers; a model of ", config.model.decoder.resolution,
                          " pixels needs ", resolutions);
    if (config.loss.code_weights.size() != code_names.size())
        fail<ConfigError>(source, ": loss.code_weights has ", config.loss.code_weights.size(),
                          " numbers; id, expr, tex and light need one each");
}

void check(const TrainConfig& config, const std::string& source) {
    const ResolutionLadder ladder = checked_ladder(config, source);
    check_losses(config, ladder.count(), source);
    check_encoder(config, source);
    check_decoder(config.model.decoder, config.optimizer.sample_tolerance, source);
    check_stage1(config, ladder, source);
    check_stage2(config, ladder, source);
}

}  // namespace

void describe(ConfigSchema& schema, TrainConfig& config) {
    describe(schema, config.model);
    describe(schema, config.data);
    describe_loss(schema, config.loss);
    describe_optimizer(schema, config.optimizer);
    describe_stage1(schema, config.stage1);
    describe_stage2(schema, config.stage2);
    describe(schema, config.discriminator);
    schema.number("memory.budget_gibibytes", config.memory.budget_gibibytes, 0.0, 1e6,
                  "memory limit of a training step in GiB; above it, activations are recomputed in "
                  "the backward pass; 0: no limit");
    describe_output(schema, config.output);
}

std::int64_t stage1_resolution(const TrainConfig& config) {
    return config.stage1.resolution > 0 ? config.stage1.resolution
                                        : config.model.decoder.resolution;
}

TrainConfig load_train_config(const std::filesystem::path& path,
                              const std::vector<std::string>& overrides) {
    TrainConfig config;
    ConfigSchema schema;
    describe(schema, config);
    schema.read_file(path);
    for (const std::string& assignment : overrides) schema.set(assignment);
    check(config, path.string());
    return config;
}

std::string to_json(const TrainConfig& config) {
    TrainConfig copy = config;
    ConfigSchema schema;
    describe(schema, copy);
    return schema.to_json();
}

std::string configuration_table() {
    TrainConfig config;
    ConfigSchema schema;
    describe(schema, config);
    return schema.to_markdown();
}

}  // namespace stymo
