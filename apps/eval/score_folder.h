#pragma once

#include <filesystem>
#include <vector>

#include "apps/eval/score.h"
#include "fit/fitter.h"

namespace stymo {

/// What an evaluation leaves behind face by face, so that it can go on after an interruption: settings.json, a line for each face
/// in scores.jsonl as they get done, and the fitted codes in codes/ID.json.
class ScoreFolder {
public:
    /// Goes on with the folder, or begins one. A line that a crash cut off is dropped. `settings`: an object of texts, numbers
    /// and truth values, named as the command line does. Throws FileError if the folder was begun with other settings, holds
    /// scores but no settings, is malformed or cannot be written.
    ScoreFolder(std::filesystem::path path, const JsonValue& settings);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    /// The scores that were there at the start.
    [[nodiscard]] const std::vector<FaceScore>& known() const { return known_; }
    [[nodiscard]] std::filesystem::path codes_of(const std::string& id) const { return path_ / "codes" / (id + ".json"); }
    /// With the codes of a fit's only row unless the face was not fitted. Written when it returns; not from several threads at
    /// once.
    void add(const FaceScore& score, const FitResult& fit);

private:
    void read_known();

    std::filesystem::path path_;
    std::filesystem::path scores_;
    std::vector<FaceScore> known_;
};

}  // namespace stymo
