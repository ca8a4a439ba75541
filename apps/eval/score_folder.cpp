#include "apps/eval/score_folder.h"

#include "core/io/file.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"

namespace stymo {

std::filesystem::path ScoreFolder::tuned_of(const std::string& id) const {
    const std::filesystem::path file = results_.path() / "tuned" / (id + ".safetensors");
    require_writable_folder(file.parent_path());
    return file;
}

void ScoreFolder::add(const FaceScore& score, const FitResult& fit) {
    if (score.regions.front().fitted) {
        require_writable_folder(codes_of(score.id).parent_path());
        write_code_file(codes_of(score.id), fit.fitted, 0, pose_from_camera(fit.cameras.front()));
    }
    // Written after the codes, so that the codes of every line exist.
    results_.append(to_json(score));
}

}  // namespace stymo
