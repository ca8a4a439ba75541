#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "fit/photo/photo_preparation.h"
#include "train/data/face_image.h"

namespace stymo {

struct FolderPreparation {
    std::filesystem::path photos;  ///< a folder in the format of scan_folder
    std::filesystem::path out;
    bool overlays = true;
};

struct FaceWarning {
    std::string id;
    std::string warning;
};

struct PrepareReport {
    std::vector<std::string>
        photos;              ///< ids of all photos, which determine the splits of the data set
    std::int64_t found = 0;  ///< photos
    std::int64_t ok = 0;     ///< photos with a face that was prepared
    std::int64_t faces = 0;
    std::int64_t aligned_already = 0;  ///< faces whose photo was already aligned
    std::int64_t made_masks = 0;  ///< faces without a known mask, or all faces with `new_masks`
    double landmark_error = 0.0;  ///< median over the faces, in units of the image's side
    std::optional<double> mask_agreement;  ///< mean intersection over union of made and known masks
    std::vector<BrokenFile> failed;
    std::vector<BrokenFile> left_out;  ///< files that are no images
    std::vector<FaceWarning> warnings;
    PoseStatistics poses;
};

/// {"found", "ok", "faces", "aligned_already", "made_masks", "landmark_error", "mask_iou": number
/// or null, "failed" and "left_out": [{"file", "reason"}], "warnings": [{"id", "warning"}],
/// "poses", "photos": [id]}
[[nodiscard]] JsonValue to_json(const PrepareReport& report);

/// The result of a call. If there is no report, the call was interrupted: the photos so far form a
/// data set, and the next call with the same settings continues.
struct PrepareOutcome {
    std::int64_t done = 0;  ///< finished photos, including those of earlier calls
    std::int64_t found = 0;
    std::int64_t done_now = 0;  ///< photos finished by this call
    std::optional<PrepareReport> report;
};

/// Makes a training set from a folder of photos: images/ID.png, masks/ID.png, faces.jsonl (pose,
/// code and landmarks of each face), camera.json, report.json, overlays/sheet_NNN.png with 64 faces
/// each. Photos are read, prepared and written a few at a time, and recorded in progress.jsonl,
/// which exists until the folder is complete. An interruption leaves a data set of the photos so
/// far. Masks in the folder of photos and landmarks in its faces.jsonl are used unchanged.
///
/// Throws FileError if `out` exists and is not a folder in preparation with the same settings, if
/// no photo can be used, or if a file cannot be written. `progress` is called with the numbers of
/// finished photos and of all photos.
[[nodiscard]] PrepareOutcome prepare_folder(
    const FolderPreparation& folders, const PhotoPreparation& preparation,
    const std::function<void(std::int64_t, std::int64_t)>& progress = {});

}  // namespace stymo
