#include "apps/eval/score_folder.h"

#include "apps/common/begun_settings.h"
#include "core/error.h"
#include "core/io/file.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"

namespace stymo {

namespace {

std::filesystem::path scores_of(const std::filesystem::path& folder, int rank) {
    return folder / (rank == 0 ? "scores.jsonl" : "scores." + std::to_string(rank) + ".jsonl");
}

/// Calls `visit` with the files of all ranks from `first` on.
template <class Visit>
void visit_ranks(const std::filesystem::path& folder, int first, const Visit& visit) {
    constexpr int most_ranks = 4096;
    for (int rank = first; rank < most_ranks; ++rank)
        if (const auto file = scores_of(folder, rank); std::filesystem::exists(file)) visit(file);
}

}  // namespace

ScoreFolder::ScoreFolder(std::filesystem::path path, const JsonValue& settings, int rank)
    : path_(std::move(path)), scores_(scores_of(path_, rank)) {
    begin_or_continue(path_, settings, "scores.jsonl");
    visit_ranks(path_, 0, [&](const std::filesystem::path& file) {
        visit_whole_lines(file, [&](const std::string& line, int, std::int64_t) {
            known_.push_back(parse_face_score(line));
            if (known_.back().regions.size() != known_.front().regions.size())
                fail<FileError>("other regions than in the lines before");
        });
    });
}

void ScoreFolder::join() const {
    visit_ranks(path_, 1, [&](const std::filesystem::path& file) {
        visit_whole_lines(file, [&](const std::string& line, int, std::int64_t) {
            append_line(scores_, line, Durability::crash_safe);
        });
        std::filesystem::remove(file);
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
