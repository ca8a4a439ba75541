#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/error.h"
#include "core/io/file.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "train/plan.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

// Steps of tiny_two_stage_config: 1 and 2 of the first stage, 3 and 4 at 64 pixels, 5 (fading) and 6 at 128.

namespace {

const Dataset& faces() {
    static const Dataset dataset = synthetic_dataset(128);
    return dataset;
}

/// The configuration whose run ends after so many of its steps.
TrainConfig cut_to(TrainConfig config, std::int64_t steps) {
    config.stage1.steps = std::min<std::int64_t>(steps, 2);
    const auto keep = static_cast<std::size_t>(std::max<std::int64_t>(0, steps - 1) / 2);
    config.stage2.resolutions.resize(keep);
    if (steps > 2 && steps % 2 == 1) config.stage2.images[keep - 1] = 2;
    return config;
}

/// The whole configuration, but for a run that is to stop early.
void train(const TrainConfig& config, const fs::path& folder, std::int64_t resume_from = -1, const Dataset* validation = nullptr) {
    const RunFolder run(folder, resume_from >= 0);
    Trainer trainer(config, faces(), validation, 5);
    if (resume_from >= 0) trainer.resume(run.checkpoint(resume_from));
    CHECK(trainer.run(run, {}).finished);
}

std::vector<nlohmann::json> statistics(const fs::path& folder) {
    std::istringstream lines(read_text_file(folder / "stats.jsonl"));
    std::vector<nlohmann::json> result;
    for (std::string line; std::getline(lines, line);) {
        result.push_back(nlohmann::json::parse(line));
        result.back().erase("images_per_second");
    }
    return result;
}

TensorFile state_at(const fs::path& folder, std::int64_t step) {
    return read_tensor_file(RunFolder(folder, true).checkpoint(step) / "state.safetensors");
}

TensorFile weights_at(const fs::path& folder, std::int64_t step) {
    return read_tensor_file(RunFolder(folder, true).checkpoint(step) / "model.safetensors");
}

bool has_prefix(const TensorFile& file, const std::string& prefix) {
    return std::ranges::any_of(file.tensors, [&](const auto& entry) { return entry.first.starts_with(prefix); });
}

/// Whether any tensor below the prefix differs.
bool moved(const TensorFile& before, const TensorFile& after, const std::string& prefix) {
    bool found = false;
    for (const auto& [name, tensor] : before.tensors) {
        if (!name.starts_with(prefix)) continue;
        found = true;
        if (!identical(tensor, after.tensors.at(name))) return true;
    }
    REQUIRE(found);
    return false;
}

/// One run with a checkpoint after each step, for all tests that only look at it.
const fs::path& whole_run() {
    struct Run {
        ScratchFolder folder;
        Run() {
            TrainConfig config = tiny_two_stage_config();
            config.output.checkpoint_steps = 1;
            config.output.keep_last = 10;
            config.output.sample_steps = 4;
            train(config, folder / "run");
            path = folder / "run";
        }
        fs::path path;
    };
    static const Run run;
    return run.path;
}

std::vector<Tensor> values_of(const Model& model) {
    std::vector<Tensor> values;
    for (const Parameter& parameter : model.parameters().all()) values.push_back(parameter.variable().value());
    return values;
}

}  // namespace

TEST_CASE("a run that stops and resumes gives the same bits in both stages and across every change of phase", "[two_stages]") {
    const std::int64_t stop = GENERATE(1, 2, 3, 4, 5);
    const ScratchFolder folder;
    TrainConfig config = tiny_two_stage_config();
    config.output.checkpoint_steps = 1;
    config.output.keep_last = 10;
    {
        const RunFolder run(folder / "run", false);
        Trainer trainer(config, faces(), nullptr, 5);
        for (std::int64_t step = 0; step < stop; ++step) static_cast<void>(trainer.step());
        // As if asked to stop: what the run leaves behind is its checkpoint.
        trainer.save(run);
    }
    train(config, folder / "run", stop);
    INFO("stopped after step " << stop);
    for (const char* file : {"checkpoints/000006/model.safetensors", "checkpoints/000006/state.safetensors", "model.safetensors"})
        CHECK(read_text_file(folder / "run" / file) == read_text_file(whole_run() / file));
    const std::vector<nlohmann::json> whole = statistics(whole_run());
    const std::vector<nlohmann::json> parts = statistics(folder / "run");
    REQUIRE(whole.size() == 6);
    REQUIRE(parts.size() == 6 - static_cast<std::size_t>(stop));
    CHECK(std::equal(parts.begin(), parts.end(), whole.begin() + static_cast<std::ptrdiff_t>(stop)));
}
