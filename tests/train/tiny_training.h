#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "render/morphable/builtin_head.h"
#include "support/tiny_model.h"
#include "train/data/dataset.h"
#include "train/data/synthetic_faces.h"
#include "train/train_config.h"

namespace stymo::test {

/// The smallest configuration that trains: 32 rays and 64 pixels a side, the smallest target of a
/// batch.
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
    config.optimizer.failures_allowed = 2;
    config.stage1 = {
        .steps = 4, .batch = 2, .micro_batch = 1, .samples_per_ray = 4, .average_half_life = 4.0};
    config.stage2.resolutions = {};
    config.output = {.tick_steps = 1,
                     .sample_steps = 0,
                     .checkpoint_minutes = 0.0,
                     .keep_last = 3,
                     .validation_images = 2};
    return config;
}

/// Both stages, the second one at 64 and at 128 pixels: two steps, then two steps of which the
/// first one fades.
[[nodiscard]] inline TrainConfig tiny_two_stage_config() {
    TrainConfig config = tiny_train_config();
    config.model.decoder.resolution = 128;
    config.model.decoder.block_channels = {6, 4};
    config.model.reconstruction.resolution_weights = {0.5, 1.0};
    config.stage1.steps = 2;
    config.stage2.resolutions = {64, 128};
    config.stage2.images = {4, 4};
    config.stage2.fade_images = {0, 4};
    config.stage2.batch = {2, 2};
    config.stage2.micro_batch = {1, 2};
    config.stage2.r1_gamma = {0.1, 0.2};
    config.stage2.r1_interval = 2;
    config.stage2.augmentation_target = 0.1;
    config.stage2.augmentation_images = 8.0;
    config.stage2.samples_per_ray = 4;
    config.stage2.average_half_life = 6.0;
    config.discriminator = {.channel_multiplier = 2.0, .max_channels = 8, .group_size = 2};
    return config;
}

/// A few faces of the built-in head, made once for the whole program.
[[nodiscard]] inline const std::filesystem::path& synthetic_folder() {
    struct Folder {
        ScratchFolder scratch;
        std::filesystem::path faces = scratch / "faces";
        Folder() {
            write_synthetic_faces(builtin_head(), {.count = 4, .side = 64, .intrinsics = {}},
                                  Rng(1), faces);
        }
    };
    static const Folder folder;
    return folder.faces;
}

[[nodiscard]] inline Dataset synthetic_dataset(std::int64_t side = 64) {
    return {synthetic_folder(), side, tiny_train_config().data, Split::all};
}

/// The lines of stats.jsonl without the speed, which no two runs share.
[[nodiscard]] inline std::vector<nlohmann::json> statistics(const std::filesystem::path& folder) {
    std::istringstream lines(read_file(folder / "stats.jsonl"));
    std::vector<nlohmann::json> result;
    for (std::string line; std::getline(lines, line);) {
        result.push_back(nlohmann::json::parse(line));
        result.back().erase("images_per_second");
        result.back().erase("exchange_share");
        result.back().erase("hidden_exchange_share");
        result.back().erase("disk_share");
    }
    return result;
}

}  // namespace stymo::test
