#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <set>
#include <vector>

#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "support/error_message.h"
#include "train/checkpoint.h"
#include "train/run_folder.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

/// As if training had written a checkpoint at this step.
void finish(const RunFolder& run, std::int64_t step, std::int64_t keep) {
    fs::create_directories(run.checkpoint(step));
    write_file(run.checkpoint(step) / "model.safetensors", "weights");
    run.finish_checkpoint(step, keep);
}

std::set<std::string> checkpoints(const RunFolder& run) {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(run.path() / "checkpoints"))
        names.insert(entry.path().filename().string());
    return names;
}

}  // namespace

TEST_CASE("a folder that holds a run is only opened to resume it", "[run_folder]") {
    const ScratchFolder folder;
    const fs::path path = folder / "run";
    {
        const RunFolder run(path, false);
        CHECK_THAT(error_message<FileError>([&] { static_cast<void>(run.latest_checkpoint()); }),
                   Catch::Contains(path.string()) && Catch::Contains("no checkpoint"));
        finish(run, 5, 3);
    }
    const std::string message =
        error_message<FileError>([&] { const RunFolder again(path, false); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains(path.string()) && Catch::Contains("--resume latest"));
    const RunFolder resumed(path, true);
    CHECK(resumed.latest_checkpoint() == resumed.checkpoint(5));
    for (const char* name : {"", "\n", "../../5", "000005x"}) {
        write_file(path / "latest", name);
        CHECK_THAT(error_message<FileError>([&] { static_cast<void>(latest_checkpoint(path)); }),
                   Catch::Contains("latest: names no checkpoint"));
    }
}

TEST_CASE("only the last checkpoints are kept, numbers of any length in order", "[run_folder]") {
    const ScratchFolder folder;
    const RunFolder run(folder / "run", false);
    for (const std::int64_t step : {9, 10, 999999, 1000000, 10000000}) finish(run, step, 3);
    CHECK(checkpoints(run) == std::set<std::string>{"999999", "1000000", "10000000"});
    CHECK(run.latest_checkpoint() == run.path() / "checkpoints/10000000");
    finish(run, 10000001, 1);
    CHECK(checkpoints(run) == std::set<std::string>{"10000001"});
}

TEST_CASE("an unfinished checkpoint is swept away and takes nobody's place", "[run_folder]") {
    const ScratchFolder folder;
    const RunFolder run(folder / "run", false);
    finish(run, 1, 2);
    fs::create_directories(run.path() / "checkpoints/000002.unfinished");
    finish(run, 3, 2);
    CHECK(checkpoints(run) == std::set<std::string>{"000001", "000003"});
}

TEST_CASE("what TensorBoard shows is written beside statistics and samples, once there are any",
          "[run_folder]") {
    const ScratchFolder folder;
    const auto event_files = [&] {
        std::vector<std::string> texts;
        for (const auto& entry : fs::directory_iterator(folder / "run")) {
            if (entry.path().filename().string().starts_with("events.out.tfevents."))
                texts.push_back(read_file(entry.path()));
        }
        return texts;
    };
    {
        const RunFolder run(folder / "run", false);
        CHECK(event_files().empty());
        run.statistics(JsonValue::object({{"step", 50},
                                          {"loss", 0.5},
                                          {"unknown", std::nan("")},
                                          {"phase", "stage1"},
                                          {"discriminator", JsonValue::object({{"real", 1}})}}));
        run.sample(50, Tensor::full({4, 8, 3}, 0.5));
    }
    REQUIRE(event_files().size() == 1);
    const std::string text = event_files()[0];
    CHECK_THAT(text, Catch::Contains("loss") && Catch::Contains("discriminator/real") &&
                         Catch::Contains("samples"));
    CHECK_THAT(
        text, !Catch::Contains("step") && !Catch::Contains("unknown") && !Catch::Contains("phase"));
    CHECK(text.find(read_file(folder / "run/samples/000050.png")) != std::string::npos);
    // A START event (field 7 holding field 1 = 1) behind the first step (field 2) that is written
    // again.
    const RunFolder resumed(folder / "run", true);
    resumed.forget_statistics_after(50);
    REQUIRE(event_files().size() == 2);
    const std::string start("\x10\x33\x3A\x02\x08\x01");
    CHECK(std::ranges::count_if(event_files(), [&](const std::string& file) {
              return file.find(start) != file.npos;
          }) == 1);
}

TEST_CASE("a checkpoint that is written again is complete or comes back, wherever a crash stops it",
          "[run_folder]") {
    const ScratchFolder folder;
    const fs::path path = folder / "run";
    fs::path checkpoint;
    {
        const RunFolder run(path, false);
        finish(run, 5, 3);
        checkpoint = run.checkpoint(5);
    }
    const fs::path unfinished = checkpoint.string() + ".unfinished";
    const fs::path replaced = checkpoint.string() + ".replaced";
    const auto write = [](const fs::path& where, const char* text) {
        fs::create_directories(where);
        write_file(where / "model.safetensors", text);
    };
    std::string expected = "weights";
    SECTION("while the new one was written") {
        write(unfinished, "ne");
    }
    SECTION("between the two renames") {
        fs::rename(checkpoint, replaced);
        write(unfinished, "new");
    }
    SECTION("before the older one was removed") {
        fs::rename(checkpoint, replaced);
        write(checkpoint, "new");
        expected = "new";
    }
    SECTION("while the older one was removed") {
        fs::create_directories(replaced);
    }
    SECTION("nowhere") {
        write_checkpoint_folder(checkpoint, [&](const fs::path& where) { write(where, "new"); });
        expected = "new";
    }
    SECTION("because the disk was full") {
        const auto stopped = [&](const fs::path& where) {
            write(where, "ne");
            fail<FileError>("no space");
        };
        CHECK_THROWS_AS(write_checkpoint_folder(checkpoint, stopped), FileError);
    }
    const RunFolder run(path, true);
    CHECK(run.latest_checkpoint() == checkpoint);
    CHECK(read_file(checkpoint / "model.safetensors") == expected);
    CHECK(checkpoints(run) == std::set<std::string>{"000005"});
}

TEST_CASE("a run resumed further back keeps its own checkpoints", "[run_folder]") {
    const ScratchFolder folder;
    const RunFolder run(folder / "run", false);
    for (const std::int64_t step : {10, 20, 30}) finish(run, step, 3);
    finish(run, 15, 3);
    CHECK(run.latest_checkpoint() == run.checkpoint(15));
    CHECK(checkpoints(run).count("000010") == 1);
    CHECK(checkpoints(run).count("000015") == 1);
    for (const std::int64_t step : {25, 35, 45, 55}) finish(run, step, 3);
    CHECK(checkpoints(run) == std::set<std::string>{"000035", "000045", "000055"});
}

TEST_CASE("statistics beyond the step that a run resumes from are dropped", "[run_folder]") {
    const ScratchFolder folder;
    const RunFolder run(folder / "run", false);
    run.forget_statistics_after(0);
    CHECK_FALSE(fs::exists(run.path() / "stats.jsonl"));
    std::string kept;
    for (const std::int64_t step : {5, 10, 15, 100}) {
        const JsonValue line = JsonValue::object({{"step", step}, {"loss", 0.5}});
        run.statistics(line);
        if (step <= 10) kept += line.text() + "\n";
    }
    run.forget_statistics_after(10);
    CHECK(read_file(run.path() / "stats.jsonl") == kept);
}

TEST_CASE("a line of statistics that a crash cut off or emptied goes too", "[run_folder]") {
    const ScratchFolder folder;
    const RunFolder run(folder / "run", false);
    const std::string whole = "{\"step\":5,\"loss\":1}\n";
    const std::string zeros(8, '\0');
    for (const std::string& rest :
         {std::string("{\"step\":10,\"lo"), zeros, zeros + "\"b\":1}\n"}) {
        write_file(run.path() / "stats.jsonl", whole + rest);
        run.forget_statistics_after(10);
        CHECK(read_file(run.path() / "stats.jsonl") == whole);
    }
}

TEST_CASE("a run folder that cannot be written is refused before anything is", "[run_folder]") {
    const ScratchFolder folder;
    write_file(folder / "file", "kept");
    for (const bool resume : {false, true}) {
        const std::string message =
            error_message<FileError>([&] { const RunFolder run(folder / "file" / "run", resume); });
        CHECK(is_one_line(message));
        CHECK_THAT(message, Catch::Contains((folder / "file").string()));
    }
    CHECK(folder.file_count() == 1);
    CHECK(read_file(folder / "file") == "kept");
}
