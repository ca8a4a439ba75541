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

/// The checkpoint that `latest` of the run folder `run` names; throws FileError if there is none.
[[nodiscard]] std::filesystem::path latest_checkpoint(const std::filesystem::path& run);

/// The folder of one training run: config.json, log.txt, stats.jsonl, events.out.tfevents.*
/// (TensorBoard; a new one whenever the run is resumed), samples/, checkpoints/NNNNNN/,
/// latest, model.safetensors.
class RunFolder {
public:
    /// Creates the folders that are missing, and after a crash repairs checkpoints and removes
    /// unfinished files. Throws FileError if the folder cannot be written, or if it holds a run
    /// already and `resume` is false.
    RunFolder(std::filesystem::path path, bool resume);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] std::filesystem::path model_file() const { return path_ / "model.safetensors"; }
    [[nodiscard]] std::filesystem::path best_file() const { return path_ / "best.safetensors"; }
    [[nodiscard]] std::filesystem::path checkpoint(std::int64_t step) const;
    [[nodiscard]] std::filesystem::path latest_checkpoint() const {
        return stymo::latest_checkpoint(path_);
    }

    /// Writes config.json; true (and a line in log.txt) if the run had another one before.
    bool replace_config(std::string_view json) const;
    /// Appends a line with the time to log.txt.
    void log(std::string_view line) const;
    /// Appends one object, whose first member is "step", to stats.jsonl, and its numbers to the
    /// event file; those of an object within are named "outer/inner" there.
    void statistics(const JsonValue& object) const;
    /// Drops everything beyond `step`, which a resumed run will write again, from stats.jsonl and
    /// from TensorBoard.
    void forget_statistics_after(std::int64_t step) const;
    /// Writes samples/NNNNNN.png, and the same image to the event file.
    void sample(std::int64_t step, const Tensor& image) const;
    /// Points `latest` at the checkpoint, once the statistics up to it are on the disk, and then
    /// removes older ones beyond the last `keep`, and unfinished ones. Checkpoints of later steps,
    /// from before a run was resumed further back, stay until the run gets past them.
    void finish_checkpoint(std::int64_t step, std::int64_t keep) const;

private:
    [[nodiscard]] EventFile& events() const;

    std::filesystem::path path_;
    /// Opened with its first entry, so that reading a run leaves no file behind.
    mutable std::optional<EventFile> events_;
};

}  // namespace stymo
