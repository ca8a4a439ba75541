#include "train/prepare.h"

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/io/image.h"
#include "core/parallel.h"
#include "render/pose_json.h"
#include "train/folder_scan.h"
#include "train/pose_overlay.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t photos_between_reports = 32;

void require_new_folder(const fs::path& folder) {
    if (fs::exists(folder) && (!fs::is_directory(folder) || !fs::is_empty(folder)))
        fail<FileError>(folder.string(), ": exists already; choose another folder or remove it");
}

/// What became of one photo.
struct Prepared {
    std::string id;
    std::optional<BrokenFile> failed;
    bool has_mask = false;
    Tensor face_box;   ///< until the rotation is known
    Matrix3 rotation;  ///< only with a pose network
};

bool is_square(const Tensor& image) {
    return image.shape(0) == image.shape(1);
}

Prepared prepare_photo(const FaceFiles& files, const fs::path& folder, std::int64_t side, const PoseNetwork* network) {
    Prepared result;
    result.id = files.id;
    const FacePicture picture = read_face_picture(files);
    if (picture.broken) {
        result.failed = picture.broken;
    } else if (!is_square(picture.image)) {
        result.failed = BrokenFile{files.image.string(), "not square: only aligned crops are read so far"};
    } else if (picture.mask.defined() && !is_square(picture.mask)) {
        result.failed = BrokenFile{files.image.string(), "its mask is not square"};
    }
    if (result.failed) return result;
    const auto pixels = static_cast<int>(side);
    write_image(folder / "images" / (files.id + ".png"), resize_image(picture.image, pixels, pixels));
    result.has_mask = picture.mask.defined();
    if (result.has_mask) write_image(folder / "masks" / (files.id + ".png"), resize_image(picture.mask, pixels, pixels));
    if (network != nullptr) result.face_box = network->face_box(picture.image);
    return result;
}

void find_rotation(Prepared& photo, const FaceFiles& files, const fs::path& folder, PoseNetwork& network) {
    try {
        photo.rotation = network.rotation(photo.face_box);
    } catch (const NumericError& error) {
        photo.failed = BrokenFile{files.image.string(), std::string("the pose network gives ") + error.what()};
        fs::remove(folder / "images" / (photo.id + ".png"));
        fs::remove(folder / "masks" / (photo.id + ".png"));
    }
    photo.face_box = Tensor();
}

std::vector<Prepared> prepare_photos(const std::vector<FaceFiles>& faces, const fs::path& folder, std::int64_t side,
                                     PoseNetwork* network, const std::function<void(std::int64_t, std::int64_t)>& progress) {
    const auto total = static_cast<std::int64_t>(faces.size());
    std::vector<Prepared> photos(faces.size());
    if (progress) progress(0, total);
    for (std::int64_t first = 0; first < total; first += photos_between_reports) {
        const std::int64_t count = std::min(photos_between_reports, total - first);
        parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                const auto place = static_cast<std::size_t>(first + i);
                photos[place] = prepare_photo(faces[place], folder, side, network);
            }
        });
        for (auto place = static_cast<std::size_t>(first); network && place < static_cast<std::size_t>(first + count); ++place)
            if (!photos[place].failed) find_rotation(photos[place], faces[place], folder, *network);
        if (interrupted()) fail("interrupted; nothing was written");
        if (progress) progress(first + count, total);
    }
    return photos;
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

AngleStatistics statistics(const std::vector<Pose>& poses, double Pose::*angle) {
    AngleStatistics result{0.0, 0.0, poses.front().*angle, poses.front().*angle};
    const auto count = static_cast<double>(poses.size());
    for (const Pose& pose : poses) {
        result.mean += pose.*angle / count;
        result.lowest = std::min(result.lowest, pose.*angle);
        result.highest = std::max(result.highest, pose.*angle);
    }
    double variance = 0.0;
    for (const Pose& pose : poses) variance += (pose.*angle - result.mean) * (pose.*angle - result.mean) / count;
    result.deviation = std::sqrt(variance);
    for (double* value : {&result.mean, &result.deviation, &result.lowest, &result.highest})
        *value = degrees_from_radians(*value);
    return result;
}

JsonValue to_json(const AngleStatistics& angle) {
    return JsonValue::object(
        {{"mean", angle.mean}, {"deviation", angle.deviation}, {"lowest", angle.lowest}, {"highest", angle.highest}});
}

/// `poses` is empty or has one for each id.
void write_records(const fs::path& folder, const std::vector<std::string>& ids, const std::vector<Pose>& poses) {
    std::string lines;
    for (std::size_t i = 0; i < ids.size(); ++i) {
        JsonValue record = JsonValue::object({{"id", ids[i]}});
        if (!poses.empty()) record.add("pose", to_json(poses[i]));
        lines += record.text() + "\n";
    }
    write_text_file(folder / "faces.jsonl", lines);
    write_intrinsics(folder / "camera.json", Intrinsics{});
}

void write_overlays(const fs::path& folder, const std::vector<std::string>& ids, const std::vector<Pose>& poses,
                    double pivot_depth) {
    constexpr std::size_t photos_in_a_sheet = 64;
    constexpr int columns = 8;
    constexpr int side = 192;
    require_writable_folder(folder / "overlays");
    for (std::size_t first = 0; first < ids.size(); first += photos_in_a_sheet) {
        std::vector<Tensor> photos;
        for (std::size_t i = first; i < std::min(first + photos_in_a_sheet, ids.size()); ++i) {
            const Tensor photo = resize_image(read_image(folder / "images" / (ids[i] + ".png")), side, side);
            photos.push_back(with_head_axes(photo, camera_from_pose(poses[i], Intrinsics{}), pivot_depth));
        }
        const std::string number = std::to_string(first / photos_in_a_sheet);
        const std::string padding(number.size() < 3 ? 3 - number.size() : 0, '0');
        write_image(folder / "overlays" / ("axes_" + padding + number + ".png"), tile_images(photos, columns));
    }
}

}  // namespace

JsonValue to_json(const PrepareReport& report) {
    std::vector<JsonValue> failed;
    for (const BrokenFile& item : report.failed)
        failed.push_back(JsonValue::object({{"file", item.file}, {"reason", item.reason}}));
    JsonValue poses;
    if (report.poses)
        poses = JsonValue::object({{"pitch_offset_deg", report.poses->pitch_offset},
                                   {"roll_offset_deg", report.poses->roll_offset},
                                   {"yaw_deg", to_json(report.poses->yaw)},
                                   {"pitch_deg", to_json(report.poses->pitch)},
                                   {"roll_deg", to_json(report.poses->roll)}});
    return JsonValue::object({{"found", report.found},
                              {"ok", report.ok},
                              {"without_mask", report.without_mask},
                              {"failed", failed},
                              {"poses", poses}});
}

std::vector<Pose> poses_from_rotations(const std::vector<Matrix3>& rotations, const PrepareSettings& settings,
                                       PoseReport& report) {
    if (rotations.empty()) fail<ValueError>("[poses] there are no rotations");
    std::vector<Vector3> angles;
    std::vector<double> pitches, rolls;
    for (const Matrix3& rotation : rotations) {
        angles.push_back(angles_from_rotation(rotation));
        pitches.push_back(angles.back()[1]);
        rolls.push_back(angles.back()[2]);
    }
    const double pitch_offset = median(pitches);
    const double roll_offset = median(rolls);
    std::vector<Pose> poses;
    for (const auto& [yaw, pitch, roll] : angles)
        poses.push_back(pivot_pose(yaw, pitch - pitch_offset, roll - roll_offset, settings.distance, settings.pivot_depth));
    report = {degrees_from_radians(pitch_offset), degrees_from_radians(roll_offset), statistics(poses, &Pose::yaw),
              statistics(poses, &Pose::pitch), statistics(poses, &Pose::roll)};
    return poses;
}

PrepareReport prepare_aligned_photos(const fs::path& photos, const fs::path& folder, const PrepareSettings& settings,
                                     PoseNetwork* network, const std::function<void(std::int64_t, std::int64_t)>& progress) {
    const FolderScan scan = scan_folder(photos);
    require_new_folder(folder);
    FolderInProgress output(folder);
    require_writable_folder(output.path() / "images");
    require_writable_folder(output.path() / "masks");

    PrepareReport report;
    report.found = static_cast<std::int64_t>(scan.faces.size());
    std::vector<std::string> ids;
    std::vector<Matrix3> rotations;
    for (const Prepared& photo : prepare_photos(scan.faces, output.path(), settings.side, network, progress)) {
        if (photo.failed) {
            report.failed.push_back(*photo.failed);
            continue;
        }
        ++report.ok;
        if (!photo.has_mask) ++report.without_mask;
        ids.push_back(photo.id);
        rotations.push_back(photo.rotation);
    }
    if (report.ok == 0)
        fail<FileError>(photos.string(), ": none of its ", report.found,
                        " photos can be used; the first: ", report.failed.front().file, ": ", report.failed.front().reason);

    std::vector<Pose> poses;
    if (network != nullptr) poses = poses_from_rotations(rotations, settings, report.poses.emplace());
    write_records(output.path(), ids, poses);
    if (settings.overlays && network != nullptr) write_overlays(output.path(), ids, poses, settings.pivot_depth);
    write_text_file(output.path() / "report.json", to_json(report).text() + "\n");
    output.finish();
    return report;
}

}  // namespace stymo
