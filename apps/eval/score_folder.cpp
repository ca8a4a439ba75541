#include "apps/eval/score_folder.h"

#include "apps/common/begun_settings.h"
#include "core/error.h"
#include "core/io/file.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"

namespace stymo {

ScoreFolder::ScoreFolder(std::filesystem::path path, const JsonValue& settings)
    : path_(std::move(path)), scores_(path_ / "scores.jsonl") {
    begin_or_continue(path_, settings, scores_.filename().string());
    visit_whole_lines(scores_, [&](const std::string& line, int, std::int64_t) {
        known_.push_back(parse_face_score(line));
        if (known_.back().regions.size() != known_.front().regions.size())
            fail<FileError>("other regions than in the lines before");
    });
}

std::filesystem::path ScoreFolder::tuned_of(const std::string& id) const {
    const std::filesystem::path file = path_ / "tuned" / (id + ".safetensors");
    require_writable_folder(file.parent_path());
    return file;
}

void ScoreFolder::add(const FaceScore& score, const FitResult& fit) {
    if (score.regions.front().fitted) {
        require_writable_folder(codes_of(score.id).parent_path());
        write_code_file(codes_of(score.id), fit.fitted, 0, pose_from_camera(fit.cameras.front()));
    }
    // Written after the codes, so that the codes of every line exist.
    append_line(scores_, to_json(score).text(), Durability::crash_safe);
}

}  // namespace stymo
