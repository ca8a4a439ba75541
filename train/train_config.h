#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "nn/models/discriminator.h"
#include "nn/models/model.h"
#include "train/data/dataset.h"

namespace stymo {

struct LossConfig {
    std::vector<double> code_weights{0.001, 0.1, 0.001, 0.01};  ///< lambda of id, expr, tex, light
    double mask_weight = 0.01;
    std::int64_t mask_start_epoch = 10;  ///< the mask loss is on from this epoch at the latest ...
    double mask_start_improvement =
        0.01;  ///< ... or from the first one that improved on the two before by less
    double opacity_weight = 0.0;         ///< accumulated opacity against the mask
    double depth_variance_weight = 0.0;  ///< variance of the depth along each ray
    double adversarial_weight = 0.1;     ///< lambda_G, second stage
    double code_norm_weight =
        0.0;  ///< squared length of the encoder's codes, which keeps them within reach of fitting
};

struct OptimizerConfig {
    double learning_rate = 1e-4;
    std::string schedule = "epoch";  ///< "epoch": times `decay` after each; "cosine": to zero over
                                     ///< the steps of stage 1
    double decay = 0.98;
    double beta1 = 0.9;
    double beta2 = 0.999;
    double epsilon = 1e-8;
    double backbone_factor = 1.0;  ///< on the learning rate of the encoder's backbone
    std::int64_t backbone_frozen_epochs = 1;
    std::string matrices =
        "adam";  ///< what moves the decoder's matrices in stage 1: "adam", "muon"
    double sample_tolerance = 0.0;  ///< compositing weight below which a sample takes no part in
                                    ///< the backward pass
    std::int64_t failures_allowed =
        20;  ///< steps in a row, of either stage, skipped for a non-finite loss or gradient
};

struct StageConfig {
    std::int64_t steps = 200000;
    std::int64_t batch = 32;
    std::int64_t micro_batch = 8;
    std::int64_t samples_per_ray = 32;
    std::int64_t resolution =
        0;  ///< of the largest image that is rendered and compared; 0: the decoder's
    double average_half_life = 0.0;  ///< half life of the EMA of the weights, in images; 0: no EMA
};

/// The second stage: the decoder against a discriminator, from 64 pixels up to the model's
/// resolution. The lists have one entry for each phase.
struct AdversarialStageConfig {
    std::vector<std::int64_t> resolutions{64, 128, 256,
                                          512};  ///< consecutive doublings; empty: no second stage
    std::vector<std::int64_t> images{200000, 300000, 300000, 500000};
    std::vector<std::int64_t> fade_images{0, 100000, 100000,
                                          100000};  ///< of them, while the new block of D fades in
    std::vector<std::int64_t> batch{32, 32, 16, 12};
    std::vector<std::int64_t> micro_batch{8, 8, 4, 4};
    std::vector<double> r1_gamma{0.026, 0.1, 0.82, 10.0};
    std::int64_t r1_interval = 16;  ///< discriminator steps from one R1 step to the next; each
                                    ///< counts as much as all of them
    double augmentation_target =
        0.0;  ///< of the mean sign of photos' logits, which augmentation keeps to; 0: there is none
    double augmentation_images = 500000.0;  ///< take its probability from 0 to 1
    std::int64_t samples_per_ray = 64;
    double learning_rate = 2e-3;
    double discriminator_learning_rate = 1e-4;
    double mapping_factor = 0.01;  ///< on the learning rate of the mapping networks
    double beta1 = 0.0;
    double beta2 = 0.99;
    double epsilon = 1e-8;
    double average_half_life =
        10000.0;  ///< half life of the EMA of the weights, in images; 0: no EMA
};

/// What a training step may use; beyond it, render blocks and field are recomputed in the backward
/// pass.
struct MemoryConfig {
    double budget_gibibytes = 0.0;  ///< 0: no limit, nothing is recomputed
};

struct OutputConfig {
    std::int64_t tick_steps = 50;
    std::int64_t sample_steps = 500;
    double checkpoint_minutes = 10.0;   ///< 0: not by time
    std::int64_t checkpoint_steps = 0;  ///< also after so many steps; 0: not by steps
    std::int64_t keep_last = 3;
    std::int64_t validation_images =
        16;  ///< held-out images that the best checkpoint is chosen by; 0: none is chosen
    std::int64_t statistics_images = 1000;  ///< training images whose codes' statistics the end of
                                            ///< a run adds to its models; 0: none
};

/// Everything a training run depends on beside its data. The defaults are the paper's.
struct TrainConfig {
    ModelConfig model;
    DataConfig data;
    LossConfig loss;
    OptimizerConfig optimizer;
    StageConfig stage1;
    AdversarialStageConfig stage2;
    DiscriminatorConfig discriminator;
    MemoryConfig memory;
    OutputConfig output;
};

void describe(ConfigSchema& schema, TrainConfig& config);

/// Side of the largest image that the first stage renders.
[[nodiscard]] std::int64_t stage1_resolution(const TrainConfig& config);

/// Reads a file with its parents, then the overrides "a.b=value", then checks what no single key
/// can: that weights are given for each resolution and code, that micro-batches divide batches and
/// groups micro-batches, that the rays suit the targets, and that the second stage leads from 64
/// pixels to the model's resolution. Throws ConfigError.
[[nodiscard]] TrainConfig load_train_config(const std::filesystem::path& path,
                                            const std::vector<std::string>& overrides);
/// Every key with its value, as `config.json` in the run folder holds it.
[[nodiscard]] std::string to_json(const TrainConfig& config);
/// Table of all keys for docs/configuration.md.
[[nodiscard]] std::string configuration_table();

}  // namespace stymo
