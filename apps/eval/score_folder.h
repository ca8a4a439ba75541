#pragma once

#include <filesystem>
#include <vector>

#include "apps/eval/score.h"
#include "fit/fitter.h"

namespace stymo {

/// Stores an evaluation face by face, so that it can continue after an interruption: settings.json,
/// one line per face in scores.jsonl, the fitted codes in codes/ID.json, and what tuning changed in
/// tuned/ID.safetensors.
class ScoreFolder {
public:
    /// Continues the folder, or begins one. A line that a crash cut off is dropped. `settings`: an
    /// object of strings, numbers and booleans with the names of command-line options. Throws
    /// FileError if the folder was begun with other settings, holds scores but no settings, is
    /// malformed or cannot be written.
    ScoreFolder(std::filesystem::path path, const JsonValue& settings);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// The scores that existed at the start.
    [[nodiscard]] const std::vector<FaceScore>& known() const { return known_; }
    [[nodiscard]] std::filesystem::path codes_of(const std::string& id) const {
        return path_ / "codes" / (id + ".json");
    }
    /// The changes that tuning made to the decoder's weights; creates the folder.
    [[nodiscard]] std::filesystem::path tuned_of(const std::string& id) const;
    /// `decoder` with these changes. Throws what WeightChanges throw.
    [[nodiscard]] Model tuned_model(const std::string& id, Model decoder) const;
    /// Adds a score, with the codes of the fit if the face was fitted. Both are on the disk when it
    /// returns. Not thread-safe.
    void add(const FaceScore& score, const FitResult& fit);

private:
    std::filesystem::path path_;
    std::filesystem::path scores_;
    std::vector<FaceScore> known_;
};

}  // namespace stymo
