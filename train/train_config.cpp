#include "train/train_config.h"

#include "core/error.h"

namespace stymo {

namespace {

void describe_loss(ConfigSchema& schema, LossConfig& config) {
    schema.numbers("loss.code_weights", config.code_weights, 0.0, 1e6,
                   "lambda of the code loss for id, expr, tex, light (paper: 0.001, 0.1, 0.001, 0.01)");
    schema.number("loss.mask_weight", config.mask_weight, 0.0, 1e6, "lambda of the mask loss (paper: 0.01)");
    schema.integer("loss.mask_start_epoch", config.mask_start_epoch, 0, 1'000'000,
                   "the mask loss is on from this epoch at the latest (paper: once training is stable)");
    schema.number(
        "loss.mask_start_improvement", config.mask_start_improvement, 0.0, 1.0,
        "or from the first epoch whose reconstruction loss improved on the two before by less than this part; 0: never early");
    schema.number("loss.opacity_weight", config.opacity_weight, 0.0, 1e6, "accumulated opacity against the mask (paper: none)");
    schema.number("loss.depth_variance_weight", config.depth_variance_weight, 0.0, 1e6,
                  "variance of the depth along each ray (paper: none)");
    schema.number("loss.code_norm_weight", config.code_norm_weight, 0.0, 1e6,
                  "mean squared number of the encoder's codes (paper: none)");
}

void describe_optimizer(ConfigSchema& schema, OptimizerConfig& config) {
    schema.number("optimizer.learning_rate", config.learning_rate, 0.0, 1.0, "Adam's learning rate in stage 1 (paper: 1e-4)");
    schema.choice("optimizer.schedule", config.schedule, {"epoch", "cosine"},
                  "epoch: times the decay after each (paper); cosine: to zero over all steps");
    schema.number("optimizer.decay", config.decay, 0.0, 1.0, "factor on the learning rate after each epoch (paper: 0.98)");
    schema.number("optimizer.beta1", config.beta1, 0.0, 0.999999, "Adam's decay of the mean");
    schema.number("optimizer.beta2", config.beta2, 0.0, 0.999999, "Adam's decay of the square");
    schema.number("optimizer.epsilon", config.epsilon, 1e-30, 1.0, "Adam's epsilon");
    schema.number("optimizer.backbone_factor", config.backbone_factor, 0.0, 100.0,
                  "factor on the learning rate of the encoder's backbone");
    schema.integer("optimizer.backbone_frozen_epochs", config.backbone_frozen_epochs, 0, 1'000'000,
                   "epochs in which the encoder's backbone stays as it is (paper: 1)");
}

void describe_stage1(ConfigSchema& schema, StageConfig& config) {
    schema.integer("stage1.steps", config.steps, 0, 100'000'000, "optimiser steps");
    schema.integer("stage1.batch", config.batch, 1, 65536, "images in one optimiser step (paper: 32)");
    schema.integer("stage1.micro_batch", config.micro_batch, 1, 65536,
                   "images computed at once; gradients add up to the batch (paper: 8)");
    schema.integer("stage1.samples_per_ray", config.samples_per_ray, 2, 4096, "N (paper: 32)");
    schema.number("stage1.average_half_life", config.average_half_life, 0.0, 1e12,
                  "images over which the averaged model forgets half; 0: none is kept");
    schema.integer("stage1.failures_allowed", config.failures_allowed, 0, 1'000'000,
                   "steps in a row that may be skipped for a loss or gradient that is not finite");
}

void describe_output(ConfigSchema& schema, OutputConfig& config) {
    schema.integer("output.tick_steps", config.tick_steps, 1, 1'000'000, "steps between two lines of statistics");
    schema.integer("output.sample_steps", config.sample_steps, 0, 100'000'000, "steps between two sample sheets; 0: none");
    schema.number("output.checkpoint_minutes", config.checkpoint_minutes, 0.0, 1e6,
                  "minutes between two checkpoints; 0: only the last one");
    schema.integer("output.keep_last", config.keep_last, 1, 1'000'000, "checkpoints kept");
    schema.integer("output.validation_images", config.validation_images, 0, 1'000'000,
                   "held-out images that the best model is chosen by; 0: none is chosen");
}

constexpr std::int64_t training_rays_per_side = 32;

void check(const TrainConfig& config, const std::string& source) {
    if (config.stage1.batch % config.stage1.micro_batch != 0) {
        fail<ConfigError>(source, ": stage1.micro_batch = ", config.stage1.micro_batch,
                          " does not divide stage1.batch = ", config.stage1.batch);
    }
    if (config.model.decoder.rays.rays_per_side != training_rays_per_side) {
        fail<ConfigError>(source, ": decoder.rays_per_side = ", config.model.decoder.rays.rays_per_side, "; training needs ",
                          training_rays_per_side, ", half the side of the smallest target");
    }
    if (config.model.decoder.rays.near_z <= config.model.decoder.rays.far_z) {
        fail<ConfigError>(source, ": decoder.near_z = ", config.model.decoder.rays.near_z,
                          ": must be above decoder.far_z = ", config.model.decoder.rays.far_z);
    }
    std::size_t resolutions = 0;
    for (std::int64_t side = 64; side <= config.model.decoder.resolution; side *= 2) ++resolutions;
    if (config.model.reconstruction.resolution_weights.size() < resolutions) {
        fail<ConfigError>(source, ": reconstruction.resolution_weights has ",
                          config.model.reconstruction.resolution_weights.size(), " numbers; a model of ",
                          config.model.decoder.resolution, " pixels needs ", resolutions);
    }
    if (config.loss.code_weights.size() != code_names.size()) {
        fail<ConfigError>(source, ": loss.code_weights has ", config.loss.code_weights.size(),
                          " numbers; id, expr, tex and light need one each");
    }
}

}  // namespace

void describe(ConfigSchema& schema, TrainConfig& config) {
    describe(schema, config.model);
    describe(schema, config.data);
    describe_loss(schema, config.loss);
    describe_optimizer(schema, config.optimizer);
    describe_stage1(schema, config.stage1);
    describe_output(schema, config.output);
}

TrainConfig load_train_config(const std::filesystem::path& path, const std::vector<std::string>& overrides) {
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
