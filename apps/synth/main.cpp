#include <filesystem>

#include "apps/common/command_line.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/progress.h"
#include "render/morphable/head_source.h"
#include "train/data/synthetic_faces.h"
#include "train/data/synthetic_people.h"

int stymo_synth(int argc, char** argv) {
    stymo::CommandLine line("stymo-synth",
                            "Renders random heads with their poses and masks as a training set.");
    std::filesystem::path folder;
    std::filesystem::path morphable;
    std::filesystem::path textured;
    stymo::SyntheticFaceSettings settings;
    stymo::SyntheticPeopleSettings people;
    line.option("--out", folder, "output folder: images, masks, faces.jsonl, camera.json")
        .required();
    line.option("--count", settings.count, "number of heads").range(1, 10000000);
    line.option("--size", settings.side, "side of the images in pixels").range(8, 4096);
    line.option("--focal", settings.intrinsics.focal,
                "focal length of the cameras in units of the image's side; heads keep their size")
        .range(0.1, 100);
    stymo::declare_head(line, morphable, "");
    line.option("--heads", textured,
                "textured heads: a .safetensors file of scripts/textured_heads.py. Their mixes are "
                "rendered instead of --count heads, without codes")
        .excludes("--morphable")
        .excludes("--count");
    line.option("--people", people.people, "number of mixes of textured heads")
        .range(1, 1000000)
        .needs("--heads");
    line.option("--views", people.views, "images of each of them").range(1, 1000).needs("--heads");
    line.option("--prefix", people.prefix, "first letters of their ids").needs("--heads");
    return line.run(argc, argv, [&](const stymo::CommonOptions& common) {
        const double start = stymo::seconds_now();
        const stymo::InterruptGuard guard;
        std::int64_t vertices = 0;
        if (!textured.empty()) {
            people.side = settings.side;
            people.intrinsics = settings.intrinsics;
            settings.count = people.people * people.views;
        }
        stymo::Progress progress({"Heads", settings.count, 0, "heads"});
        const auto update = [&](std::int64_t done) { progress.update(done); };
        const stymo::Rng rng(common.seed);
        if (textured.empty()) {
            const stymo::MorphableHead head = stymo::morphable_head_from(morphable);
            vertices = head.vertex_count();
            stymo::write_synthetic_faces(head, settings, rng, folder, update);
        } else {
            const stymo::TexturedHeads heads = stymo::read_textured_heads(textured);
            vertices = heads.vertices.shape(1);
            stymo::write_synthetic_people(heads, people, rng, folder, update);
        }
        progress.finish();
        const double seconds = stymo::seconds_now() - start;
        return stymo::AppResult{stymo::text_from(settings.count, " heads of ", settings.side, " x ",
                                                 settings.side, " pixels in ", folder.string()),
                                stymo::JsonValue::object({{"folder", folder.string()},
                                                          {"count", settings.count},
                                                          {"size", settings.side},
                                                          {"vertices", vertices},
                                                          {"seconds", seconds}})};
    });
}
