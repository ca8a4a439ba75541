#pragma once

#include <filesystem>

#include "apps/common/result_folder.h"
#include "apps/eval/score.h"
#include "fit/fitter.h"

namespace stymo {

/// Stores an evaluation face by face, so that it can continue after an interruption: settings.json,
/// one line per face in scores.jsonl, the fitted codes in codes/ID.json, and the weight changes of
/// tuning in tuned/ID.safetensors.
class ScoreFolder {
public:
    /// Continues the folder, or will begin one. Throws what ResultFolder throws.
    ScoreFolder(const std::filesystem::path& path, const Settings& settings, Ranks& ranks)
        : results_(path, settings, "scores", "id", ranks) {}

    [[nodiscard]] ResultFolder& results() { return results_; }
    /// The score of a face that has one. Throws FileError for a line that is none.
    [[nodiscard]] FaceScore score(const std::string& id) const {
        return results_.read(id, parse_face_score);
    }
    [[nodiscard]] std::filesystem::path codes_of(const std::string& id) const {
        return results_.path() / "codes" / (id + ".json");
    }
    /// The file of the weight changes of tuning. Creates its folder.
    [[nodiscard]] std::filesystem::path tuned_of(const std::string& id) const;
    /// Adds a score, and the codes of the fit if the face was fitted. Both are on the disk when
    /// this function returns. Not thread-safe.
    void add(const FaceScore& score, const FitResult& fit);

private:
    ResultFolder results_;
};

}  // namespace stymo
