#include <filesystem>
#include <optional>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/tools.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/progress.h"
#include "render/morphable/head_source.h"
#include "train/data/synthetic_faces.h"

int stymo_synth(int argc, char** argv) {
    stymo::CommandLine line(
        "stymo-synth",
        "Renders random morphable heads with their codes, poses and masks as a training set.");
    std::filesystem::path folder;
    std::filesystem::path morphable;
    stymo::SyntheticFaceSettings settings;
    line.option("--out", folder, "output folder: images, masks, faces.jsonl, camera.json")
        .required();
    line.option("--count", settings.count, "number of heads").range(1, 10000000);
    line.option("--size", settings.side, "side of the images in pixels").range(8, 4096);
    line.option(
        "--morphable", morphable,
        "head model: a .safetensors file or a folder of ICT-FaceKit (default: the built-in head)");
    return line.run(argc, argv, [&](const stymo::CommonOptions& common) {
        const double start = stymo::seconds_now();
        const stymo::MorphableHead head = stymo::morphable_head_from(morphable);
        const stymo::InterruptGuard guard;
        stymo::Progress progress({"Heads", settings.count, 0, "heads"});
        stymo::write_synthetic_faces(head, settings, stymo::Rng(common.seed), folder,
                                     [&](std::int64_t done) { progress.update(done); });
        progress.finish();
        const double seconds = stymo::seconds_now() - start;
        std::ostringstream text;
        text << settings.count << " heads of " << settings.side << " x " << settings.side
             << " pixels in " << folder.string();
        return stymo::AppResult{text.str(),
                                stymo::JsonValue::object({{"folder", folder.string()},
                                                          {"count", settings.count},
                                                          {"size", settings.side},
                                                          {"vertices", head.vertex_count()},
                                                          {"seconds", seconds}})};
    });
}
