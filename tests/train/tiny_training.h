#pragma once

#include "core/io/scratch_folder.h"
#include "render/morphable/builtin_head.h"
#include "support/tiny_model.h"
#include "train/dataset.h"
#include "train/synthetic_faces.h"
#include "train/train_config.h"

namespace stymo::test {

/// The smallest configuration that trains: 32 rays and 64 pixels a side, the smallest target of a batch.
[[nodiscard]] inline TrainConfig tiny_train_config() {
    TrainConfig config;
    config.model = tiny_model_config();
    config.model.decoder.rays.rays_per_side = 32;
    config.model.decoder.resolution = 64;
    config.data.test = 0;
    config.data.validation = 0;
    config.data.mirror = true;
    config.loss.opacity_weight = 0.2;
    config.loss.depth_variance_weight = 0.2;
    config.loss.code_norm_weight = 0.1;
    config.optimizer.learning_rate = 1e-3;
    config.stage1 = {
        .steps = 4, .batch = 2, .micro_batch = 1, .samples_per_ray = 4, .average_half_life = 4.0, .failures_allowed = 2};
    config.output = {.tick_steps = 1, .sample_steps = 0, .checkpoint_minutes = 0.0, .keep_last = 3, .validation_images = 2};
    return config;
}

/// A few faces of the built-in head, made once for the whole program.
[[nodiscard]] inline const std::filesystem::path& synthetic_folder() {
    struct Folder {
        ScratchFolder scratch;
        std::filesystem::path faces = scratch / "faces";
        Folder() { write_synthetic_faces(builtin_head(), {.count = 4, .side = 64, .intrinsics = {}}, Rng(1), faces); }
    };
    static const Folder folder;
    return folder.faces;
}

[[nodiscard]] inline Dataset synthetic_dataset() {
    return {synthetic_folder(), 64, tiny_train_config().data, Split::all};
}

}  // namespace stymo::test
