#include <algorithm>
#include <string>

#include "apps/bench/case.h"
#include "apps/bench/small_model.h"
#include "apps/bench/work.h"
#include "core/io/folder_in_progress.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"
#include "train/trainer.h"

namespace stymo {

namespace {

/// A step of the first stage as `stymo-train` does it: eight images, encoder and its backbone,
/// LPIPS, optimiser, EMA. The images are synthetic heads, and the weights of backbone and LPIPS
/// random ones, which does not change the time. Of the work only decoder and trunk are counted:
/// forwards and twice as much backwards through the decoder; photo, image and back through the
/// trunk.
Measurement training_step(const BenchRun& run, const std::string& configuration) {
    const TrainConfig config = embedded_configuration(
        configuration,
        {"stage2.resolutions=[]", "data.split.test=0", "encoder.backbone_weights=random",
         "reconstruction.perceptual_trunk=random", "reconstruction.perceptual_heads=random"});
    const FolderInProgress folder(std::filesystem::temp_directory_path() / "stymo-bench-heads");
    const std::int64_t side = config.model.decoder.resolution;
    write_synthetic_faces(builtin_head(),
                          {.count = 2 * config.stage1.batch,
                           .side = side,
                           .intrinsics = config.model.camera.intrinsics},
                          Rng(run.seed).split("heads"), folder.path());
    const Dataset faces(folder.path(), side, config.data, Split::training);
    Trainer trainer(config, faces, nullptr, run.seed);
    Measurement result{.timing = time_repeated(run.options.repeats, 0.0,
                                               [&] { static_cast<void>(trainer.step()); })};
    result.peak_memory = peak_memory_mebibytes();
    const double decoder = frame_work(trainer.model()).of_frame(config.stage1.samples_per_ray);
    const double trunk = trunk_work(config.model.reconstruction.perceptual.network, side);
    result.work = 3.0 * static_cast<double>(config.stage1.batch) * (decoder + trunk);
    return result;
}

}  // namespace

std::vector<BenchCase> training_cases() {
    const auto row = [](const std::string& configuration, auto measure) {
        return BenchCase{"train-" + configuration, "training",
                         "stage 1, eight images, LPIPS (SqueezeNet), `" + configuration + "`",
                         measure, configuration};
    };
    return {
        row("celeba-64", [](const BenchRun& run) { return training_step(run, "celeba-64"); }),
        row("celeba-128", [](const BenchRun& run) { return training_step(run, "celeba-128"); }),
        row("celeba-256", [](const BenchRun& run) { return training_step(run, "celeba-256"); })};
}

}  // namespace stymo
