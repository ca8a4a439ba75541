// stymo-weights as its users call it.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::ScratchFolder;
using stymo::ToolOutcome;

const std::string golden = std::string(STYMO_SOURCE_DIR) + "/tests/golden/weights/";

}  // namespace

TEST_CASE("stymo-weights imports a checkpoint of PyTorch, making the folder it goes to") {
    const ScratchFolder folder;
    const ToolOutcome outcome = run_tool(
        folder.path(), "stymo-weights import " + golden + "views.pth new/views.safetensors --json");
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    const json result = json::parse(outcome.out);
    CHECK(result["written"] == "new/views.safetensors");
    CHECK(result["recognised"] == "");
    CHECK(result["tensors"] == 6);
    const stymo::TensorFile file = stymo::read_tensor_file(folder / "new/views.safetensors");
    CHECK(file.tensors.at("part").to_vector() == std::vector<double>{6, 8, 10, 12, 14, 16});
}

TEST_CASE(
    "stymo-weights recognises LPIPS' heads, writes their network's name, and shows what it wrote") {
    const ScratchFolder folder;
    stymo::TensorFile heads;
    const std::vector<std::int64_t> channels{64, 128, 256, 512, 512};
    for (std::size_t i = 0; i < channels.size(); ++i)
        heads.tensors["lin" + std::to_string(i) + ".model.1.weight"] =
            stymo::Tensor::full({1, channels[i], 1, 1}, 0.5);
    stymo::write_tensor_file(folder / "heads", heads);
    const ToolOutcome imported =
        run_tool(folder.path(), "stymo-weights import heads vgg.safetensors");
    CHECK(imported.out == "vgg.safetensors: LPIPS heads (vgg), 5 tensors, 1472 values\n");
    CHECK(imported.err.empty());

    const ToolOutcome shown = run_tool(folder.path(), "stymo-weights show vgg.safetensors");
    CHECK_THAT(shown.out, Catch::StartsWith("vgg.lin0.model.1.weight  float32  (1, 64, 1, 1)") &&
                              Catch::Contains("norm 4\n") &&
                              Catch::EndsWith("5 tensors, 1472 values\n"));
    const json listed =
        json::parse(run_tool(folder.path(), "stymo-weights show vgg.safetensors --json").out);
    CHECK(listed["values"] == 1472);
    CHECK(listed["tensors"].size() == 5);
    CHECK(listed["tensors"][0] == json{{"name", "vgg.lin0.model.1.weight"},
                                       {"shape", {1, 64, 1, 1}},
                                       {"type", "float32"},
                                       {"norm", 4.0}});
}

TEST_CASE("stymo-weights widens a model, and asks by what if it is not told") {
    const ScratchFolder folder;
    const std::string model = (stymo::tiny_run() / "run/model.safetensors").string();
    const ToolOutcome wide =
        run_tool(folder.path(), "stymo-weights widen " + model +
                                    " wide.safetensors --set decoder.field_width=40 --json");
    INFO(wide.err);
    REQUIRE(wide.exit_code == 0);
    CHECK(json::parse(wide.out)["written"] == "wide.safetensors");
    CHECK(stymo::read_tensor_file(folder / "wide.safetensors")
              .tensors.at("decoder.field.density.weight")
              .shape(1) == 40);

    const ToolOutcome untold =
        run_tool(folder.path(), "stymo-weights widen " + model + " none.safetensors");
    CHECK(untold.exit_code == 2);
    CHECK_THAT(untold.err, Catch::Contains("widen needs --set"));
    const ToolOutcome narrower =
        run_tool(folder.path(),
                 "stymo-weights widen " + model + " none.safetensors --set decoder.field_width=2");
    CHECK(narrower.exit_code == 1);
    CHECK_THAT(narrower.err, Catch::Contains("at least as many channels"));
    CHECK_FALSE(fs::exists(folder / "none.safetensors"));
}

TEST_CASE("What stymo-weights cannot or will not read gives one line and no file") {
    const ScratchFolder folder;
    stymo::write_file(folder / "zero.pth", "");
    stymo::write_file(folder / "page.pth", "<!DOCTYPE html>");
    stymo::write_file(folder / "cut.pth", stymo::read_file(golden + "views.pth").substr(0, 2000));
    const std::vector<std::pair<std::string, std::string>> refused = {
        {"none.pth", "none.pth: cannot be read"},
        {"zero.pth", "zero.pth: not a weight file (zero bytes)"},
        {"page.pth", "page.pth: not a weight file (neither"},
        {"cut.pth", "cut.pth: not a readable PyTorch file ("},
        {golden + "system.pth",
         "system.pth: refuses to load \"posix.system\": not a tensor or container"},
        {golden + "external.onnx", "external.onnx: tensor \"conv.weight\" is kept in another file"},
    };
    for (const auto& [in, culprit] : refused) {
        for (const std::string& command : {"import " + in + " out.safetensors", "show " + in}) {
            const ToolOutcome outcome = run_tool(folder.path(), "stymo-weights " + command);
            CHECK(outcome.exit_code == 1);
            CHECK(outcome.out.empty());
            CHECK(stymo::line_count(outcome.err) == 1);
            CHECK_THAT(outcome.err,
                       Catch::StartsWith("stymo-weights: ") && Catch::Contains(culprit));
        }
    }
    CHECK_FALSE(fs::exists(folder / "out.safetensors"));
    CHECK_FALSE(fs::exists(folder / "executed"));
    for (const std::string command : {"", "import", "import a.pth", "import a.pth out.pth", "show"})
        CHECK(run_tool(folder.path(), "stymo-weights " + command).exit_code == 2);
}
