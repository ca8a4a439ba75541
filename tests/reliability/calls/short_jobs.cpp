#include "reliability/calls/short_jobs.h"

#include <catch2/catch.hpp>
#include <stdexcept>

#include "core/io/file.h"
#include "reliability/same_run.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

constexpr const char* configuration = R"({
  "decoder": {"resolution": 128, "field_width": 8, "field_layers": 1, "feature_channels": 8,
              "frequencies": 2, "block_channels": [8, 8], "mapping_layers": 1},
  "encoder": {"backbone": "small_conv", "head_width": 8},
  "reconstruction": {"resolution_weights": [0.5, 1.0], "perceptual_weight": 0,
                     "fit_samples_per_ray": 2},
  "data": {"split": {"test": 1, "val": 1, "held_out": "last"}},
  "stage1": {"steps": 1, "batch": 1, "micro_batch": 1, "samples_per_ray": 2},
  "stage2": {"resolutions": [64, 128], "images": [1, 1], "fade_images": [0, 1], "batch": [1, 1],
             "micro_batch": [1, 1], "r1_gamma": [0.1, 0.2], "r1_interval": 1,
             "augmentation_target": 0.1, "augmentation_images": 16, "samples_per_ray": 2},
  "discriminator": {"channel_multiplier": 1, "max_channels": 4, "group_size": 1},
  "output": {"tick_steps": 1, "sample_steps": 2, "checkpoint_minutes": 0, "checkpoint_steps": 2,
             "keep_last": 1, "statistics_images": 1}
})";

const std::string train = "stymo-train --config short.json --data faces --out ";

void must(const fs::path& folder, const std::string& command) {
    const ToolOutcome outcome = RunningCopy(folder, command).wait();
    if (outcome.exit_code != 0) throw std::runtime_error(command + ": " + outcome.err);
}

class ShortData {
public:
    ShortData() {
        write_file(path() / "short.json", configuration);
        must(path(), "stymo-synth --out faces --count 4 --size 64");
        must(path(), train + "whole");
        must(path(), train + "begun --max-minutes 1e-6");
        fs::create_directory(path() / "photos");
        for (const char* photo : {"00000.png", "00003.png"})
            fs::copy_file(path() / "faces/images" / photo, path() / "photos" / photo);
        must(path(), fit() + "fit");
        must(path(), prepare() + "prepared");
    }
    [[nodiscard]] const fs::path& path() const { return folder_.path(); }

    static std::string fit() {
        return "stymo-fit --model whole/model.safetensors --data faces --id 00003 --steps 1 "
               "--tune-steps 4 --out ";
    }
    [[nodiscard]] std::string prepare() const {
        // A preparation remembers the folder of its photos.
        return "stymo-prep --photos " + (path() / "photos").string() + " --size 64 --out ";
    }

private:
    ScratchFolder folder_;
};

const ShortData& made_data() {
    static const ShortData data;
    return data;
}

std::function<void(const fs::path&)> same_files(const std::string& whole,
                                                std::vector<std::string> files) {
    return [expected = short_data() / whole, files = std::move(files)](const fs::path& out) {
        for (const std::string& file : files) {
            INFO(file);
            const bool equal = read_file(out / file) == read_file(expected / file);
            CHECK(equal);
        }
    };
}

std::string resumed_if_possible(const fs::path& out) {
    return train + out.string() + (fs::exists(out / "latest") ? " --resume latest" : "");
}

void compare_training(const fs::path& out) {
    check_same_run(out, short_data() / "whole", 3);
}

}  // namespace

const fs::path& short_data() {
    return made_data().path();
}

ShortJob training() {
    static_cast<void>(short_data());
    return {"training", train, resumed_if_possible, compare_training, {}};
}

ShortJob resumed_training() {
    return {"resumed training",
            "stymo-train --config short.json --data faces --resume latest --out ",
            resumed_if_possible, compare_training, short_data() / "begun"};
}

ShortJob fitting() {
    const std::string command = ShortData::fit();
    return {"fit",
            command,
            [command](const fs::path& out) { return command + out.string(); },
            same_files("fit", {"codes.json", "tuned.safetensors", "fit.png"}),
            {}};
}

ShortJob preparation() {
    const std::string command = made_data().prepare();
    return {"preparation",
            command,
            [command](const fs::path& out) { return command + out.string(); },
            same_files("prepared", {"faces.jsonl", "camera.json", "images/00003.png"}),
            {}};
}

}  // namespace stymo
