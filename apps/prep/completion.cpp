#include <fstream>
#include <functional>

#include "apps/prep/photo_outcome.h"
#include "apps/prep/pipeline.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/median.h"
#include "core/parallel.h"
#include "fit/photo/preparation_overlay.h"
#include "train/data/folder_records.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t faces_in_a_sheet = 64;
constexpr int columns = 8;
constexpr std::int64_t thumbnail_side = 192;

/// Values of all faces that are needed at once. All others stay in the records.
struct Summary {
    PrepareReport report;
    std::vector<double> landmark_errors;
    std::vector<double> mask_agreements;
    std::vector<Eigen::Matrix3d> rotations;  ///< empty without a network
    std::vector<Pose> poses;  ///< of the morphable fit, then the network's if there is one
};

Summary summary_of(const FolderPreparation& folders, const PivotCamera& pivot,
                   std::span<const std::string> files, const ResultFolder& notes) {
    Summary summary;
    PrepareReport& report = summary.report;
    report.found = std::ssize(files);
    for (const std::string& file : files) {
        const PhotoOutcome photo = notes.read(file, parse_photo_outcome);
        if (!photo.failure.empty())
            report.failed.push_back({(folders.photos / file).string(), photo.failure});
        if (!photo.faces.empty()) ++report.ok;
        for (const FaceOutcome& face : photo.faces) {
            ++report.faces;
            report.aligned_already += face.was_aligned ? 1 : 0;
            report.made_masks += face.made_mask ? 1 : 0;
            summary.landmark_errors.push_back(face.fit.landmark_error);
            if (face.mask_agreement) summary.mask_agreements.push_back(*face.mask_agreement);
            for (const std::string& warning : face.warnings)
                report.warnings.push_back({face.id, warning});
            summary.poses.push_back(face.fit.pose);
            if (face.network_rotation) summary.rotations.push_back(*face.network_rotation);
        }
    }
    if (report.ok == 0) return summary;
    if (!summary.rotations.empty() && summary.rotations.size() != summary.poses.size())
        fail<FileError>(folders.out.string(),
                        ": the pose network's rotation is missing for some faces; remove the "
                        "folder and start again");
    report.landmark_error = median(summary.landmark_errors);
    if (const std::vector<double>& all = summary.mask_agreements; !all.empty()) {
        double sum = 0.0;
        for (const double agreement : all) sum += agreement;
        report.mask_agreement = sum / static_cast<double>(all.size());
    }
    if (summary.rotations.empty()) {
        report.poses = statistics_of(summary.poses);
    } else {
        summary.poses = poses_from_rotations(summary.rotations, pivot, report.poses);
    }
    return summary;
}

/// Calls `visit` with each face and its final pose, in order.
void for_each_face(std::span<const std::string> files, const ResultFolder& notes,
                   const std::vector<Pose>& poses, const std::function<void(FaceOutcome)>& visit) {
    std::size_t index = 0;
    for (const std::string& file : files) {
        for (FaceOutcome& face : notes.read(file, parse_photo_outcome).faces) {
            face.fit.pose = poses[index++];
            visit(std::move(face));
        }
    }
}

void write_sheet(const fs::path& out, std::size_t number, const PhotoPreparation& preparation,
                 std::span<const FaceOutcome> faces) {
    std::vector<Tensor> thumbnails(faces.size());
    const Intrinsics& intrinsics = preparation.settings().intrinsics;
    parallel_items(std::ssize(faces), [&](std::size_t i, int /*thread*/) {
        const std::string name = faces[i].id + ".png";
        thumbnails[i] =
            preparation_overlay({read_image(out / "images" / name), read_mask(out / "masks" / name),
                                 faces[i].landmarks, faces[i].fit},
                                preparation.head(), intrinsics, thumbnail_side);
    });
    const std::string digits = std::to_string(number);
    const std::string padding(digits.size() < 3 ? 3 - digits.size() : 0, '0');
    write_image(out / "overlays" / ("sheet_" + padding + digits + ".png"),
                tile_images(thumbnails, columns));
}

/// Returns false if a signal came.
bool write_sheets(const fs::path& out, const PhotoPreparation& preparation,
                  std::span<const std::string> files, const ResultFolder& notes,
                  const std::vector<Pose>& poses) {
    require_writable_folder(out / "overlays");
    std::vector<FaceOutcome> sheet;
    std::size_t number = 0;
    const auto write = [&] {
        if (!sheet.empty() && !interrupted()) write_sheet(out, number++, preparation, sheet);
        sheet.clear();
    };
    for_each_face(files, notes, poses, [&](FaceOutcome face) {
        sheet.push_back(std::move(face));
        if (sheet.size() == faces_in_a_sheet) write();
    });
    write();
    return !interrupted();
}

std::vector<JsonValue> to_json(const std::vector<BrokenFile>& files) {
    std::vector<JsonValue> values;
    for (const BrokenFile& item : files)
        values.push_back(JsonValue::object({{"file", item.file}, {"reason", item.reason}}));
    return values;
}

}  // namespace

std::optional<PrepareReport> write_data_set(const FolderPreparation& folders,
                                            const PhotoPreparation& preparation,
                                            std::span<const std::string> files,
                                            const std::vector<std::string>& photo_ids,
                                            const std::vector<BrokenFile>& left_out,
                                            ResultFolder& notes, bool complete) {
    Summary summary = summary_of(folders, preparation.settings().pivot, files, notes);
    PrepareReport& report = summary.report;
    report.photos = photo_ids;
    report.left_out = left_out;
    if (report.ok == 0 && !complete) return std::nullopt;
    if (report.ok == 0) {
        for (const char* name :
             {"images", "masks", "unknown", "faces.jsonl", "camera.json", "report.json"})
            fs::remove_all(folders.out / name);
        notes.remove();
        fail<FileError>(folders.photos.string(), ": none of its ", report.found,
                        " photos can be used; the first: ", report.failed.front().file, ": ",
                        report.failed.front().reason);
    }
    write_whole(folders.out / "faces.jsonl", [&](const fs::path& temporary) {
        std::ofstream stream(temporary, std::ios::binary);
        for_each_face(files, notes, summary.poses, [&](const FaceOutcome& face) {
            stream << face_record(face, face.fit.pose).text() << '\n';
        });
        stream.flush();
        if (!stream)
            fail<FileError>((folders.out / "faces.jsonl").string(),
                            ": cannot be written; is the disk full?");
    });
    write_intrinsics(folders.out / "camera.json", preparation.settings().intrinsics);
    write_file(folders.out / "report.json", to_json(report).text() + "\n");
    if (!complete) return std::move(summary.report);
    if (folders.overlays && !write_sheets(folders.out, preparation, files, notes, summary.poses))
        return std::nullopt;
    notes.remove();
    return std::move(summary.report);
}

JsonValue to_json(const PrepareReport& report) {
    std::vector<JsonValue> warnings;
    for (const FaceWarning& item : report.warnings)
        warnings.push_back(JsonValue::object({{"id", item.id}, {"warning", item.warning}}));
    return JsonValue::object(
        {{"found", report.found},
         {"ok", report.ok},
         {"faces", report.faces},
         {"aligned_already", report.aligned_already},
         {"made_masks", report.made_masks},
         {"landmark_error", report.landmark_error},
         {"mask_iou", report.mask_agreement ? JsonValue(*report.mask_agreement) : JsonValue()},
         {"failed", to_json(report.failed)},
         {"left_out", to_json(report.left_out)},
         {"warnings", warnings},
         {"poses", to_json(report.poses)},
         {"photos", report.photos}});
}

}  // namespace stymo
