#include <catch2/catch.hpp>

#include "core/ops/ops.h"
#include "support/check_close.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

namespace training_sources_tests {

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

/// The synthetic faces, the first two of which are of one source.
fs::path faces_with_sources(const ScratchFolder& scratch) {
    const fs::path folder = scratch / "faces";
    fs::copy(synthetic_folder(), folder, fs::copy_options::recursive);
    std::istringstream lines(read_file(folder / "faces.jsonl"));
    std::string line, named;
    for (int number = 0; std::getline(lines, line); ++number) {
        nlohmann::json record = nlohmann::json::parse(line);
        if (number < 2) record["source"] = "studio";
        named += record.dump() + "\n";
    }
    write_file(folder / "faces.jsonl", named);
    return folder;
}

TEST_CASE("A run learns the light of a source, keeps it by name, and compares identities",
          "[trainer]") {
    const ScratchFolder scratch;
    TrainConfig config = tiny_train_config();
    config.loss.identity_weight = 0.1;
    config.loss.identity_network = "random";
    const Dataset faces(faces_with_sources(scratch), 64, config.data, Split::all);
    const auto train = [&](const char* name, std::int64_t steps, std::int64_t resume_from) {
        config.stage1.steps = steps;
        const RunFolder run(scratch / name, resume_from >= 0);
        Trainer trainer(config, faces, nullptr, 5);
        if (resume_from >= 0) trainer.resume(run.checkpoint(resume_from));
        static_cast<void>(trainer.run(run, {}));
        return read_tensor_file(run.checkpoint(steps) / "state.safetensors");
    };
    const TensorFile whole = train("whole", 4, -1);
    const Tensor light = whole.tensors.at("sources.studio");
    CHECK(light.shape() == Shape{code_sizes[3]});
    CHECK(sum(abs(Variable(light))).value().item() > 0.0);
    static_cast<void>(train("parts", 2, -1));
    CHECK(identical(train("parts", 4, 2).tensors.at("sources.studio"), light));
    for (const nlohmann::json& line : statistics(scratch / "whole"))
        CHECK(line["identity"].get<double>() > 0.0);
    const TensorFile model = read_tensor_file(scratch / "whole" / "model.safetensors");
    CHECK_FALSE(model.tensors.contains("sources.studio"));
}

}  // namespace training_sources_tests
