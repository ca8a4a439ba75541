#include "apps/render/new_faces.h"

#include <cmath>
#include <iomanip>
#include <iostream>
#include <sstream>

#include "apps/common/face_input.h"
#include "core/io/folder_in_progress.h"
#include "nn/realtime/view.h"
#include "train/training_codes.h"

namespace stymo {

namespace {

constexpr std::int64_t most_statistics_faces = 1000;

CodeStatistics statistics_of(const RenderOptions& options, const Model& model) {
    if (options.data.empty()) {
        if (model.code_statistics()) return *model.code_statistics();
        fail<FileError>(
            model_file(options.model).string(),
            ": has no statistics of codes to draw faces from; name a folder of faces with --data");
    }
    const Dataset faces(options.data, model.config().decoder.resolution, {.cache_megabytes = 0},
                        Split::all, model.config().camera);
    const std::optional<CodeStatistics> statistics =
        code_statistics_of(model, faces, most_statistics_faces);
    write_left_out(std::cerr, faces.summary().left_out);
    write_broken_files(std::cerr, faces.summary(), 0);
    if (!statistics)
        fail<FileError>(options.data.string(), ": statistics of codes need two faces or more");
    return *statistics;
}

std::string code_file_name(std::size_t index) {
    std::ostringstream text;
    text << std::setw(4) << std::setfill('0') << index << ".json";
    return text.str();
}

}  // namespace

WrittenImages write_new_faces(const RenderOptions& options, const Model& model, std::uint64_t seed,
                              Explainer& explainer) {
    const CodeStatistics statistics = statistics_of(options, model);
    const Rng rng = Rng(seed).split("new faces");
    const Pose pose = chosen_pose(options, model, frontal_pose(model.config().camera));
    Rng unused(0);
    const Codes rest = options.codes.empty() ? statistics.sample(unused, 0.0)
                                             : read_code_file(options.codes).codes;
    ShotList list;
    for (int i = 0; i < options.sample; ++i) {
        Rng own = rng.split(static_cast<std::uint64_t>(i));
        list.shots.push_back(
            {interpolated(rest, statistics.sample(own, options.truncation), 1.0, options.take),
             pose});
    }
    list.columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(options.sample))));
    FolderInProgress folder(options.out);
    WrittenImages result =
        write_images(folder.path() / "faces.png", options, model, list, explainer);
    std::vector<std::filesystem::path>& written = result.files;
    for (std::size_t i = 0; i < list.shots.size(); ++i) {
        written.push_back(folder.path() / code_file_name(i));
        write_code_file(written.back(), list.shots[i].codes, 0, pose);
    }
    folder.finish();
    for (std::filesystem::path& path : written) path = options.out / path.filename();
    return result;
}

}  // namespace stymo
