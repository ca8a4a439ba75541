#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/io/json_writer.h"
#include "fit/photo/photo_preparation.h"
#include "train/face_picture.h"

namespace stymo {

struct FolderPreparation {
    std::filesystem::path photos;  ///< a folder as scan_folder reads it
    std::filesystem::path out;
    bool overlays = true;
};

struct FaceWarning {
    std::string id;
    std::string warning;
};

struct PrepareReport {
    std::int64_t found = 0;  ///< photos
    std::int64_t ok = 0;     ///< photos with a face that was prepared
    std::int64_t faces = 0;
    std::int64_t aligned_already = 0;      ///< faces whose photo was left as it is
    std::int64_t made_masks = 0;           ///< faces without a known mask, or all with `new_masks`
    double landmark_error = 0.0;           ///< median over the faces, in units of the picture's side
    std::optional<double> mask_agreement;  ///< mean intersection over union of masks made and known
    std::vector<BrokenFile> failed;
    std::vector<FaceWarning> warnings;
    PoseStatistics poses;
};

/// {"found", "ok", "faces", "aligned_already", "made_masks", "landmark_error", "mask_iou": number or null, "failed": [{"file",
/// "reason"}], "warnings": [{"id", "warning"}], "poses"}
[[nodiscard]] JsonValue to_json(const PrepareReport& report);

/// How far a call came. Without a report it was interrupted, and the next call with the same settings goes on.
struct PrepareOutcome {
    std::int64_t done = 0;  ///< photos, those of former calls included
    std::int64_t found = 0;
    std::int64_t done_now = 0;  ///< photos of this call
    std::optional<PrepareReport> report;
};

/// Makes a training set of a folder of photos: images/ID.png, masks/ID.png, faces.jsonl (pose, code and landmarks of each
/// face), camera.json, report.json, overlays/sheet_NNN.png with 64 faces each. Photos are read, prepared and written a few at a
/// time, and noted in progress.jsonl, which is there until the folder is complete. A mask of the photo's folder is used as it is,
/// and so are landmarks of its faces.jsonl.
///
/// Throws FileError if `out` exists and is not a folder in preparation with the same settings, if no photo can be used, or
/// if something cannot be written. `progress` is called with the number of photos done and of all.
[[nodiscard]] PrepareOutcome prepare_folder(const FolderPreparation& folders, const PhotoPreparation& preparation,
                                            const std::function<void(std::int64_t, std::int64_t)>& progress = {});

}  // namespace stymo
