#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "nn/models/discriminator.h"
#include "nn/models/model.h"
#include "train/data/dataset.h"

namespace stymo {

struct LossConfig {
    std::vector<double> code_weights{0.001, 0.1, 0.001, 0.01};  ///< lambda for id, expr, tex, light
    double mask_weight = 0.01;
    std::int64_t mask_start_epoch = 10;  ///< latest epoch from which the mask loss is on
    /// The mask loss is switched on earlier after an epoch whose loss is less than this share below
    /// the lower one of the two epochs before; 0: never earlier.
    double mask_start_improvement = 0.01;
    double opacity_weight = 0.0;         ///< weight of the opacity of rays against the mask
    double depth_variance_weight = 0.0;  ///< weight of the variance of the depth along each ray
    double adversarial_weight = 0.1;     ///< lambda_G, second stage
    /// Weight of the squared length of the codes, learnt offsets included, which keeps them in the
    /// range that fitting reaches.
    double code_norm_weight = 0.0;
    /// Weight of 1 - cosine between rendered face and photo in a face recognition network.
    double identity_weight = 0.0;
    /// The same for half of the faces, seen from half a radian to one side.
    double side_identity_weight = 0.0;
    std::string identity_network{};  ///< its weights (IdentityNetwork)
    /// Weight of what faces with another face's expression fail to show of it (`aside_side`).
    double expression_weight = 0.0;

    [[nodiscard]] bool compares_identity() const {
        return identity_weight > 0.0 || side_identity_weight > 0.0;
    }
};

struct OptimizerConfig {
    double learning_rate = 1e-4;
    std::string schedule = "epoch";  ///< "epoch": multiplied by `decay` after each epoch; "cosine":
                                     ///< falls to zero over stage 1
    double decay = 0.98;
    double beta1 = 0.9;
    double beta2 = 0.999;
    double epsilon = 1e-8;
    double backbone_factor = 1.0;  ///< factor on the learning rate of the encoder's backbone
    std::int64_t backbone_frozen_epochs = 1;
    /// Optimiser of hidden matrices in stage 1: "adam", "muon" for the decoder's, or "muon_encoder"
    /// for the encoder's too.
    std::string matrices = "adam";
    double sample_tolerance = 0.0;  ///< samples of smaller compositing weight get no gradient
    /// Largest number of consecutive steps that are skipped for a non-finite loss or gradient.
    std::int64_t failures_allowed = 20;
};

struct StageConfig {
    std::int64_t steps = 200000;
    std::int64_t batch = 32;
    std::int64_t micro_batch = 8;
    std::int64_t samples_per_ray = 32;
    /// Side of the largest image that is rendered and compared; 0: the decoder's resolution.
    std::int64_t resolution = 0;
    double average_half_life = 0.0;  ///< half life of the EMA of the weights, in images; 0: no EMA
    /// The decoder and the offsets of sources stay as they are. The encoder learns, and offsets of
    /// photos where they are asked for.
    bool decoder_frozen = false;
    /// The encoder's backbone and heads stay as they are.
    bool encoder_frozen = false;
    /// Every n-th step also learns offsets of the poses of its photos; 0: no step does.
    std::int64_t pose_interval = 0;
};

/// The second stage: adversarial training of the decoder, from 64 pixels up to the model's
/// resolution. The lists have one entry for each phase.
struct AdversarialStageConfig {
    /// Each is twice the one before; empty: no second stage.
    std::vector<std::int64_t> resolutions{64, 128, 256, 512};
    std::vector<std::int64_t> images{200000, 300000, 300000, 500000};
    /// How many of these images it takes to fade in the discriminator's new block.
    std::vector<std::int64_t> fade_images{0, 100000, 100000, 100000};
    std::vector<std::int64_t> batch{32, 32, 16, 12};
    std::vector<std::int64_t> micro_batch{8, 8, 4, 4};
    std::vector<double> r1_gamma{0.026, 0.1, 0.82, 10.0};
    /// Discriminator steps from one R1 step to the next; R1 is weighted by this number.
    std::int64_t r1_interval = 16;
    /// Target of the mean sign of the photos' logits, to which the augmentation adapts; 0: no
    /// augmentation.
    double augmentation_target = 0.0;
    /// Images in which the augmentation probability can rise from 0 to 1.
    double augmentation_images = 500000.0;
    std::int64_t samples_per_ray = 64;
    double learning_rate = 2e-3;
    double discriminator_learning_rate = 1e-4;
    double mapping_factor = 0.01;  ///< factor on the learning rate of the mapping networks
    double beta1 = 0.0;
    double beta2 = 0.99;
    double epsilon = 1e-8;
    /// Half life of the EMA of the weights, in images; 0: no EMA.
    double average_half_life = 10000.0;
};

/// Memory budget of a training step. If a step needs more, micro-batches are computed one after the
/// other and activations are recomputed (choose_execution).
struct MemoryConfig {
    double budget_gibibytes = 0.0;  ///< 0: no limit, nothing is recomputed
};

struct OutputConfig {
    std::int64_t tick_steps = 50;
    std::int64_t sample_steps = 500;
    double checkpoint_minutes = 10.0;   ///< 0: not by time
    std::int64_t checkpoint_steps = 0;  ///< also after this number of steps; 0: not by steps
    std::int64_t keep_last = 3;
    /// Number of held-out images by which the best checkpoint is chosen; 0: none is chosen.
    std::int64_t validation_images = 16;
    /// Training images from whose codes the statistics are computed that are added to the models at
    /// the end of a run; 0: none.
    std::int64_t statistics_images = 1000;
};

/// Everything on which a training run depends, besides data and seed. The defaults are the paper's.
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

/// Reads a file with its parents and applies the overrides "a.b=value". Then it checks the keys
/// against each other: that there are weights for each resolution and code, that micro-batches
/// divide batches and group sizes divide micro-batches, that the rays match the targets, and that
/// the second stage leads from 64 pixels to the model's resolution. Throws ConfigError.
[[nodiscard]] TrainConfig load_train_config(const std::filesystem::path& path,
                                            const std::vector<std::string>& overrides);
/// Every key with its value, in the format of `config.json` in the run folder.
[[nodiscard]] std::string to_json(const TrainConfig& config);
/// Table of all keys for configs/keys.md.
[[nodiscard]] std::string configuration_table();

}  // namespace stymo
