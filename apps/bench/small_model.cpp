#include "apps/bench/small_model.h"

#include "apps/bench/embedded_configurations.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"
#include "train/trainer.h"

namespace stymo {

TrainConfig embedded_configuration(const std::string& name,
                                   const std::vector<std::string>& overrides) {
    const FolderInProgress folder(std::filesystem::temp_directory_path() / "stymo-report-config");
    for (const auto& [file, text] : embedded_configurations) write_file(folder.path() / file, text);
    return load_train_config(folder.path() / (name + ".json"), overrides);
}

TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray) {
    return embedded_configuration("demo-64",
                                  {"stage1.steps=" + std::to_string(steps),
                                   "stage1.samples_per_ray=" + std::to_string(samples_per_ray),
                                   "stage1.average_half_life=0"});
}

void write_small_heads(const std::filesystem::path& folder, std::uint64_t seed) {
    const ModelConfig model = small_training(1, 2).model;
    write_synthetic_faces(builtin_head(),
                          {.count = small_heads,
                           .side = model.decoder.resolution,
                           .intrinsics = model.camera.intrinsics},
                          Rng(seed).split("heads"), folder);
}

void write_small_model(const std::filesystem::path& heads, const std::filesystem::path& file,
                       std::uint64_t seed, double seconds) {
    constexpr std::int64_t steps = 3200, samples = 16;
    TrainConfig config = small_training(steps, samples);
    // The number of steps that fit into the time is not known beforehand.
    config.optimizer.schedule = "epoch";
    const Dataset faces(heads, config.model.decoder.resolution, config.data, Split::training);
    Trainer trainer(config, faces, nullptr, seed);
    const double begin = seconds_now();
    for (std::int64_t step = 0; step < steps && seconds_now() - begin < seconds; ++step) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        static_cast<void>(trainer.step());
    }
    trainer.model().save(file);
}

}  // namespace stymo
