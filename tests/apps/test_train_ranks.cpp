// stymo-train under mpirun, as real processes.
#include <catch2/catch.hpp>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "apps/common/child_process.h"
#include "apps/common/ranked_run.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/matmul_precision.h"
#include "train/data/dataset.h"
#include "train/train_config.h"
#include "train/trainer.h"

namespace train_rank_tests {

namespace {

namespace fs = std::filesystem;
using stymo::ChildOutcome;
using stymo::tiny_run;

/// stymo-train on one thread in so many processes; `more` is added to its command, and `of_last`
/// to that of the last rank alone.
ChildOutcome train(int ranks, const std::string& out, const std::string& more,
                   const std::string& of_last = "") {
    const auto in_folder = [](const std::string& name) { return (tiny_run() / name).string(); };
    std::ostringstream command, line;
    command << STYMO_BINARY_DIR "/bin/stymo-train --threads 1 --config " << in_folder("tiny.json")
            << " --data " << in_folder("faces") << " --out " << in_folder(out) << ' ' << more;
    line << "mpirun --oversubscribe -n " << (of_last.empty() ? ranks : ranks - 1) << ' '
         << command.str();
    if (!of_last.empty()) line << " : -n 1 " << command.str() << ' ' << of_last;
    return stymo::run_ranks(stymo::words(line.str()));
}

/// Lines of stderr that are the tool's own.
std::vector<std::string> complaints(const ChildOutcome& outcome) {
    std::vector<std::string> found;
    for (std::size_t at = outcome.err.find("stymo-train: "); at != std::string::npos;
         at = outcome.err.find("stymo-train: ", at + 1))
        found.push_back(outcome.err.substr(at, outcome.err.find('\n', at) - at));
    return found;
}

std::string bytes(const std::string& file) {
    return stymo::read_file(tiny_run() / file);
}

}  // namespace

TEST_CASE("1, 2 and 4 ranks write the same files, and any number resumes", "[slow]") {
    if (!stymo::can_start_ranks()) return;
    const std::string steps =
        "--set stage1.batch=4 --set stage1.micro_batch=1 --set output.checkpoint_steps=2 ";
    for (const int ranks : {1, 2, 4})
        REQUIRE(train(ranks, "ranks" + std::to_string(ranks), steps).exit_code == 0);
    const std::string state = "/checkpoints/000004/state.safetensors";
    for (const std::string run : {"ranks2", "ranks4"}) {
        CHECK(bytes(run + "/model.safetensors") == bytes("ranks1/model.safetensors"));
        CHECK(bytes(run + state) == bytes("ranks1" + state));
    }
    const std::string from = "--resume " + (tiny_run() / "ranks4/checkpoints/000002").string();
    REQUIRE(train(2, "resumed", steps + from).exit_code == 0);
    CHECK(bytes("resumed" + state) == bytes("ranks1" + state));

    // What a crash leaves between the two renames of a checkpoint that replaces another.
    const fs::path checkpoint = tiny_run() / "ranks4/checkpoints/000002";
    fs::rename(checkpoint, checkpoint.string() + ".replaced");
    REQUIRE(train(2, "repaired", steps + from).exit_code == 0);
    CHECK(fs::exists(checkpoint));
    CHECK(bytes("repaired" + state) == bytes("ranks1" + state));
}

TEST_CASE("Ranks that do not fit together are refused by one line, and nothing is written",
          "[slow]") {
    if (!stymo::can_start_ranks()) return;
    const auto refused = [](const ChildOutcome& outcome, const std::string& words) {
        CHECK(outcome.exit_code != 0);
        REQUIRE(complaints(outcome).size() == 1);
        CHECK_THAT(complaints(outcome).front(), Catch::Contains(words));
        CHECK_FALSE(fs::exists(tiny_run() / "refused"));
    };
    refused(train(4, "refused", ""), "4 ranks cannot share the 1 micro-batches");
    const std::string two = "--set stage1.micro_batch=1";
    refused(train(2, "refused", two, "--seed 3"), "rank 1 has a seed that differs");
    refused(train(2, "refused", two, "--set stage1.steps=9"),
            "rank 1 has a configuration that differs");
    refused(train(2, "refused", two, "--resume /nowhere"), "rank 1 on ");
    if (std::string(stymo::bfloat16_instructions()) != "none")
        refused(train(2, "refused", two, "--matmul-precision highest"),
                "rank 1 has a precision of matrix products that differs");
    CHECK(train(2, "default_precision", two, "--matmul-precision medium").exit_code == 0);
    refused(train(2, "refused", two + " --dry-run"), "--dry-run measures one process");
}

TEST_CASE("A rank that cannot write ends all of them, and the checkpoints stay") {
    if (!stymo::can_start_ranks()) return;
    const std::string steps = "--set stage1.micro_batch=1 --set output.checkpoint_steps=2 ";
    REQUIRE(train(2, "blocked", steps).exit_code == 0);
    const std::string state = bytes("blocked/checkpoints/000004/state.safetensors");
    fs::remove(tiny_run() / "blocked/stats.jsonl");
    fs::create_directory(tiny_run() / "blocked/stats.jsonl");
    const ChildOutcome outcome =
        train(2, "blocked", steps + "--set stage1.steps=20 --resume latest");
    CHECK(outcome.exit_code != 0);
    REQUIRE(complaints(outcome).size() == 1);
    CHECK_THAT(complaints(outcome).front(), Catch::Contains("rank 0 on "));
    CHECK(bytes("blocked/checkpoints/000004/state.safetensors") == state);
}

TEST_CASE("Ranks whose photos have other poses, landmarks or masks are told apart") {
    const stymo::ScratchFolder folder;
    const fs::path faces = folder.path() / "faces";
    fs::copy(tiny_run() / "faces", faces, fs::copy_options::recursive);
    stymo::TrainConfig config = stymo::load_train_config(tiny_run() / "tiny.json", {});
    const auto state = [&] {
        return stymo::common_state(
            config, stymo::faces_for_training(faces, config, stymo::Split::training), {}, {});
    };
    const stymo::CommonState before = state();
    CHECK(state() == before);
    const std::string records = stymo::read_file(faces / "faces.jsonl");
    const std::size_t yaw = records.find("\"yaw_deg\":") + 10;
    stymo::write_file(faces / "faces.jsonl",
                      records.substr(0, yaw) + "1" + records.substr(records.find(',', yaw)));
    CHECK(state() != before);
    stymo::write_file(faces / "faces.jsonl", records);
    CHECK(state() == before);
    stymo::write_image(faces / "masks/00000.png", stymo::Tensor::full({64, 64, 1}, 1.0));
    CHECK(state() != before);
}

}  // namespace train_rank_tests
