#pragma once

#include <filesystem>
#include <vector>

#include "apps/eval/score.h"
#include "fit/fitter.h"

namespace stymo {

/// Stores an evaluation face by face, so that it can continue after an interruption: settings.json,
/// one line per face in scores.jsonl, the fitted codes in codes/ID.json, and the weight changes of
/// tuning in tuned/ID.safetensors.
class ScoreFolder {
public:
    /// Continues the folder, or begins one. `settings` is an object of strings, numbers and
    /// booleans with the names of command-line options. A partial last line, which a crash leaves,
    /// is dropped. Throws FileError if the folder was begun with other settings, holds scores but
    /// no settings, is malformed or cannot be written.
    ScoreFolder(std::filesystem::path path, const JsonValue& settings);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// The scores that the folder had at construction.
    [[nodiscard]] const std::vector<FaceScore>& known() const { return known_; }
    [[nodiscard]] std::filesystem::path codes_of(const std::string& id) const {
        return path_ / "codes" / (id + ".json");
    }
    /// The file of the weight changes of tuning. Creates its folder.
    [[nodiscard]] std::filesystem::path tuned_of(const std::string& id) const;
    /// Adds a score, and the codes of the fit if the face was fitted. Both are on the disk when
    /// this function returns. Not thread-safe.
    void add(const FaceScore& score, const FitResult& fit);

private:
    std::filesystem::path path_;
    std::filesystem::path scores_;
    std::vector<FaceScore> known_;
};

}  // namespace stymo
