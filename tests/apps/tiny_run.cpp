#include "apps/tiny_run.h"

#include <stdexcept>

#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"

namespace stymo {

namespace {

constexpr const char* configuration = R"({
  "decoder": {"resolution": 64, "field_width": 16, "field_layers": 2, "feature_channels": 16,
              "frequencies": 4, "block_channels": [16], "mapping_layers": 1},
  "encoder": {"backbone": "small_conv", "head_width": 32},
  "reconstruction": {"resolution_weights": [1.0], "perceptual_weight": 0, "fit_samples_per_ray": 4},
  "data": {"split": {"test": 2, "val": 0, "held_out": "last"}},
  "stage1": {"steps": 4, "batch": 2, "micro_batch": 2, "samples_per_ray": 4},
  "stage2": {"resolutions": []},
  "output": {"tick_steps": 1, "sample_steps": 2, "checkpoint_minutes": 0}
})";

class TinyRun {
public:
    TinyRun() {
        write_file(path() / "tiny.json", configuration);
        must("stymo-synth --out faces --count 12 --size 64");
        must("stymo-train --config tiny.json --data faces --out run");
        must("stymo-fit --model run/model.safetensors --data faces --id 00011 --out fit --steps 3");
        must("stymo-render --model run/model.safetensors --codes fit/codes.json --out whole.jpg");
        std::filesystem::create_directory(path() / "empty");
        write_file(path() / "zero.png", "");
        write_file(path() / "text.png", "no image\n");
        write_file(path() / "file", "");
        cut("faces/images/00000.png", "cut.png");
        cut("whole.jpg", "cut.jpg");
        cut("run/model.safetensors", "cut.safetensors");
    }
    [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }

private:
    void must(const std::string& command) const {
        const ToolOutcome outcome = run_tool(path(), command);
        if (outcome.exit_code != 0) throw std::runtime_error(command + ": " + outcome.err);
    }
    void cut(const char* whole, const char* half) const {
        const std::string text = read_file(path() / whole);
        write_file(path() / half, text.substr(0, text.size() / 2));
    }

    ScratchFolder folder_;
};

}  // namespace

const std::filesystem::path& tiny_run() {
    static const TinyRun run;
    return run.path();
}

}  // namespace stymo
