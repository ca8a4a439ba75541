#include "reliability/same_run.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>
#include <string>

#include "core/io/file.h"
#include "train/run_folder.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

/// Names of all files but those of TensorBoard, whose names hold the time.
std::string listing(const fs::path& run) {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(run)) {
        const std::string name = entry.path().lexically_relative(run).string();
        if (!name.starts_with("events.")) names.insert(name);
    }
    std::string text;
    for (const std::string& name : names) text += name + "\n";
    return text;
}

}  // namespace

void check_same_run(const fs::path& run, const fs::path& expected, int steps) {
    const fs::path checkpoint = latest_checkpoint(expected).lexically_relative(expected);
    for (const fs::path& file : {fs::path("model.safetensors"), checkpoint / "model.safetensors",
                                 checkpoint / "state.safetensors"}) {
        INFO(file);
        // Not by CHECK, which would print megabytes.
        const bool equal = read_file(run / file) == read_file(expected / file);
        CHECK(equal);
    }
    const std::string statistics = read_file(run / "stats.jsonl");
    CHECK(std::ranges::count(statistics, '\n') == steps);
    CHECK(listing(run) == listing(expected));
}

}  // namespace stymo
