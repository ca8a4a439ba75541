#include "apps/bench/report/small_model.h"

#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "render/morphable/builtin_head.h"
#include "train/synthetic_faces.h"
#include "train/trainer.h"

namespace stymo {

TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray) {
    TrainConfig config;
    DecoderConfig& decoder = config.model.decoder;
    decoder.resolution = small_side;
    decoder.field_width = 64;
    decoder.field_layers = 4;
    decoder.feature_channels = 64;
    decoder.frequencies = 6;
    decoder.depth_planes = "optical_axis";
    decoder.rays.near_z = 1.6;
    decoder.rays.far_z = -1.6;
    decoder.block_channels = {64};
    config.model.encoder.backbone = "small_conv";
    config.model.encoder.head_width = 256;
    config.model.camera.pivot_depth = 0.0;
    ReconstructionConfig& reconstruction = config.model.reconstruction;
    reconstruction.resolution_weights = {1.0};
    reconstruction.perceptual_weight = 0.0;
    reconstruction.fit_samples_per_ray = 16;
    reconstruction.fit_regularizer = 1e-4;
    config.data.test = small_held_out;
    config.data.validation = 0;
    config.data.held_out = "last";
    config.loss.code_weights = {1e-4, 1e-4, 1e-4, 1e-3};
    config.loss.mask_weight = 0.1;
    config.loss.mask_start_epoch = 2;
    config.loss.opacity_weight = 0.2;
    config.loss.depth_variance_weight = 0.2;
    config.optimizer.learning_rate = 3e-3;
    config.optimizer.schedule = "cosine";
    config.stage1.steps = steps;
    config.stage1.batch = 4;
    config.stage1.micro_batch = 2;
    config.stage1.samples_per_ray = samples_per_ray;
    config.stage2.resolutions.clear();
    config.output.tick_steps = 50;
    config.output.sample_steps = 250;
    config.output.checkpoint_minutes = 0.0;
    return config;
}

void write_small_heads(const std::filesystem::path& folder, std::uint64_t seed) {
    const SyntheticFaceSettings settings{
        .count = small_heads, .side = small_side, .intrinsics = small_training(1, 2).model.camera.intrinsics};
    write_synthetic_faces(builtin_head(), settings, Rng(seed).split("heads"), folder);
}

void write_small_model(const std::filesystem::path& heads, const std::filesystem::path& file, std::uint64_t seed,
                       double seconds) {
    constexpr std::int64_t steps = 3200, samples = 16;
    TrainConfig config = small_training(steps, samples);
    // How many steps there are time for is not known beforehand.
    config.optimizer.schedule = "epoch";
    const Dataset faces(heads, small_side, config.data, Split::training);
    Trainer trainer(config, faces, nullptr, seed);
    const double begin = seconds_now();
    for (std::int64_t step = 0; step < steps && seconds_now() - begin < seconds; ++step) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        static_cast<void>(trainer.step());
    }
    trainer.model().save(file);
}

}  // namespace stymo
