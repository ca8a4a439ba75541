#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "fit/photo/face_detector.h"
#include "render/morphable/builtin_head.h"
#include "train/landmarks/head_pictures.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace {

const std::string small = " --steps 2 --batch 2 --heads 2 --new-heads 1";

ToolOutcome succeed(const std::filesystem::path& folder, const std::string& command) {
    ToolOutcome outcome = run_tool(folder, command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

}  // namespace

TEST_CASE("stymo-landmarks trains the same network with the same seed") {
    const ScratchFolder folder;
    const ToolOutcome first =
        succeed(folder.path(), "stymo-landmarks train --out a.safetensors --json" + small);
    CHECK(nlohmann::json::parse(first.out).at("written") == "a.safetensors");
    succeed(folder.path(), "stymo-landmarks train --out b.safetensors" + small);
    succeed(folder.path(), "stymo-landmarks train --out c.safetensors --seed 1" + small);
    const auto bytes = [&](const char* name) { return read_file(folder / name); };
    CHECK(bytes("a.safetensors") == bytes("b.safetensors"));
    CHECK(bytes("a.safetensors") != bytes("c.safetensors"));
    succeed(folder.path(), "stymo-landmarks train --out a.safetensors --sheet sheet.png");
    CHECK(read_image(folder / "sheet.png").shape(1) == 8 * 160);
}

TEST_CASE("stymo-landmarks refuses what it cannot use, in one line") {
    const ScratchFolder folder;
    const auto refused = [&](const std::string& command, int code, const std::string& reason) {
        const ToolOutcome outcome = run_tool(folder.path(), "stymo-landmarks " + command);
        INFO(command);
        CHECK(outcome.exit_code == code);
        CHECK_THAT(outcome.err, Contains(reason));
        CHECK(line_count(outcome.err) == 1);
        CHECK(outcome.out.empty());
    };
    write_file(folder / "marks.json", "{}");
    refused("", 2, "a command is required: train, adapt, measure");
    refused("train --out a.txt", 2, "a.txt: the name must end in .safetensors");
    refused("train --out a.safetensors --batch 0", 2, "--batch: 0 is not a number in [1, 4096]");
    refused("train --out a.safetensors --photos nowhere", 1, "nowhere");
    refused("adapt --model none.safetensors --photos . --out a.safetensors", 1, "none.safetensors");
    refused("measure --marked marks.json --photos .", 1, "marks.json: not {\"photos\"");
}

TEST_CASE("stymo-landmarks adapts a network to photos and measures it") {
    if (!FaceDetector::available()) return;
    const ScratchFolder folder;
    // Rendered heads in which dlib finds faces stand for photos.
    const MorphableHead head = builtin_head();
    const HeadPictures pictures(head);
    std::filesystem::create_directories(folder / "photos");
    for (std::uint64_t k = 0; k < 6; ++k) {
        const Tensor image = pictures.draw(Rng(k)).image;
        Tensor photo({image.shape(0), image.shape(1), 3});
        for (std::size_t at = 0; at < photo.values<float>().size(); ++at)
            photo.mutable_values<float>()[at] = image.values<float>()[at / 3 * 4 + at % 3];
        write_image(folder / "photos" / (std::to_string(k) + ".png"), photo);
    }
    succeed(folder.path(), "stymo-landmarks train --out a.safetensors" + small);
    const ToolOutcome adapted =
        run_tool(folder.path(),
                 "stymo-landmarks adapt --model a.safetensors --photos photos --rounds 1 "
                 "--out b.safetensors" +
                     small);
    // A network without training may find nothing.
    if (adapted.exit_code != 0) CHECK_THAT(adapted.err, Contains("no face was found"));
    write_file(folder / "marks.json", R"({"photos": [
        {"file": "0.png", "points": {"36": [50, 60], "45": [90, 60]}},
        {"file": "1.png", "points": {"36": [50, 60], "45": [90, 60]}}]})");
    const ToolOutcome measured = run_tool(
        folder.path(),
        "stymo-landmarks measure --marked marks.json --photos photos --model a.safetensors "
        "--overlays overlays --json");
    if (measured.exit_code == 0)
        CHECK(nlohmann::json::parse(measured.out).at("photos").size() <= 2);
    else
        CHECK_THAT(measured.err, Contains("no face was found"));
}
