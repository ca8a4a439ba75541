#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/io/event_file.h"
#include "core/io/json_writer.h"
#include "core/tensor.h"

namespace stymo {

/// The checkpoint that the file `latest` in the run folder `run` names. Throws FileError if there
/// is none.
[[nodiscard]] std::filesystem::path latest_checkpoint(const std::filesystem::path& run);

/// The folder of one training run: config.json, log.txt, stats.jsonl, events.out.tfevents.*
/// (TensorBoard; a new one whenever the run is resumed), samples/, checkpoints/NNNNNN/,
/// latest, model.safetensors.
class RunFolder {
public:
    /// Creates the folders that are missing, and after a crash repairs checkpoints and removes
    /// unfinished files. Throws FileError if the folder cannot be written to, or if it already
    /// holds a run and `resume` is false.
    RunFolder(std::filesystem::path path, bool resume);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] std::filesystem::path model_file() const { return path_ / "model.safetensors"; }
    [[nodiscard]] std::filesystem::path best_file() const { return path_ / "best.safetensors"; }
    [[nodiscard]] std::filesystem::path checkpoint(std::int64_t step) const;
    [[nodiscard]] std::filesystem::path latest_checkpoint() const {
        return stymo::latest_checkpoint(path_);
    }

    /// Writes config.json. Returns true, and adds a line to log.txt, if the run had another
    /// configuration before.
    bool replace_config(std::string_view json) const;
    /// Appends a line with the time to log.txt.
    void log(std::string_view line) const;
    /// Appends one object, whose first member is "step", to stats.jsonl, and its numbers to the
    /// event file. There, numbers of a nested object are named "outer/inner".
    void statistics(const JsonValue& object) const;
    /// Removes the entries beyond `step` from stats.jsonl and from TensorBoard. A resumed run
    /// writes them again.
    void forget_statistics_after(std::int64_t step) const;
    /// Writes samples/NNNNNN.png, and the same image to the event file.
    void sample(std::int64_t step, const Tensor& image) const;
    /// Sets `latest` to the checkpoint, after the statistics up to it are on the disk. Then removes
    /// unfinished checkpoints and all but the last `keep` complete ones. Checkpoints of later
    /// steps, from before the run was resumed at an earlier step, are kept until the run passes
    /// them.
    void finish_checkpoint(std::int64_t step, std::int64_t keep) const;

private:
    [[nodiscard]] EventFile& events() const;

    std::filesystem::path path_;
    /// Opened with its first entry, so that reading a run creates no file.
    mutable std::optional<EventFile> events_;
};

}  // namespace stymo
