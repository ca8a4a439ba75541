#include "train/data/synthetic_folder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/io/image.h"
#include "core/parallel.h"
#include "render/camera_matrices.h"
#include "train/data/folder_records.h"

namespace stymo::synthetic {

namespace {

/// Images of an earlier run would silently become part of the set.
void require_no_other_images(const std::filesystem::path& folder,
                             const std::vector<std::string>& ids) {
    std::set<std::string> ours;
    for (const std::string& id : ids) ours.insert(id + ".png");
    for (const char* name : {"images", "masks"}) {
        if (!std::filesystem::is_directory(folder / name)) continue;
        for (const auto& entry : std::filesystem::directory_iterator(folder / name)) {
            if (!ours.contains(entry.path().filename().string())) {
                fail<FileError>(entry.path().string(), ": does not belong to the ", ids.size(),
                                " faces to be written; choose another folder or remove it");
            }
        }
    }
}

}  // namespace

double truncated_normal(Rng& rng, double deviation, double limit) {
    double value = deviation * rng.normal();
    while (std::abs(value) > limit) value = deviation * rng.normal();
    return value;
}

std::vector<float> sample_light(Rng rng) {
    std::vector<float> light(27);
    std::array<double, 9> grey{};
    grey[0] = 0.84 + truncated_normal(rng, 0.07, 0.16);
    grey[1] = 0.09 + truncated_normal(rng, 0.05, 0.12);   // from above: y points down
    grey[2] = -0.13 + truncated_normal(rng, 0.05, 0.12);  // from the front: z points away
    grey[3] = truncated_normal(rng, 0.10, 0.22);
    for (std::size_t k = 4; k < grey.size(); ++k) grey[k] = truncated_normal(rng, 0.02, 0.05);
    std::array<double, 3> tint{};
    for (double& value : tint) value = 1.0 + truncated_normal(rng, 0.02, 0.05);
    for (std::size_t k = 0; k < grey.size(); ++k) {
        for (std::size_t channel = 0; channel < 3; ++channel) {
            const double colored = k == 0 ? 0.0 : truncated_normal(rng, 0.006, 0.015);
            light[3 * k + channel] = static_cast<float>(grey[k] * tint[channel] + colored);
        }
    }
    return light;
}

std::string padded_number(std::int64_t number) {
    const std::string digits = std::to_string(number);
    return std::string(digits.size() < 5 ? 5 - digits.size() : 0, '0') + digits;
}

Pose at_focal(const Pose& pose, double focal) {
    const Intrinsics usual;
    if (focal == usual.focal) return pose;
    return pose_from_camera(with_focal(camera_from_pose(pose, usual), focal));
}

void write_faces(const std::vector<std::string>& ids, const Intrinsics& intrinsics,
                 const std::filesystem::path& folder,
                 const std::function<WrittenFace(std::int64_t)>& render,
                 const std::function<void(std::int64_t)>& progress) {
    require_no_other_images(folder, ids);
    FolderInProgress output(folder);
    require_writable_folder(output.path() / "images");
    require_writable_folder(output.path() / "masks");
    write_intrinsics(output.path() / "camera.json", intrinsics);

    constexpr std::int64_t faces_between_reports = 16;
    for (std::int64_t first = 0; first < std::ssize(ids); first += faces_between_reports) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const std::int64_t count = std::min(faces_between_reports, std::ssize(ids) - first);
        std::vector<std::string> records(static_cast<std::size_t>(count));
        parallel_items(count, [&](std::int64_t item, int /*thread*/) {
            const std::int64_t index = first + item;
            const std::string& id = ids[static_cast<std::size_t>(index)];
            const WrittenFace face = render(index);
            write_image(output.path() / "images" / (id + ".png"), face.image);
            write_image(output.path() / "masks" / (id + ".png"), face.mask);
            records[static_cast<std::size_t>(item)] = face.record.text();
        });
        for (const std::string& record : records)
            append_line(output.path() / "faces.jsonl", record, Durability::none);
        if (progress) progress(first + count);
    }
    output.finish();
}

}  // namespace stymo::synthetic
