#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "apps/common/result_folder.h"
#include "fit/photo/photo_preparation.h"
#include "train/data/folder_scan.h"

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
/// each. The ranks take the photos in turn. They are read, prepared and written a few at a time,
/// and recorded in progress.jsonl, which exists until the folder is complete, as settings.json
/// does. An interruption leaves a data set of the photos so far. Masks in the folder of photos and
/// landmarks in its faces.jsonl are used unchanged. The files have the same bits for any number of
/// ranks.
class PreparationRun {
public:
    /// Writes nothing. `preparation` and `ranks` must outlive the object. Throws FileError if the
    /// photos cannot be listed, or if `out` exists and is not a folder in preparation with the same
    /// settings.
    PreparationRun(FolderPreparation folders, const PhotoPreparation& preparation,
                   const Settings& settings, Ranks& ranks);

    /// What must be the same on all ranks.
    [[nodiscard]] CommonState state() const { return results_.state(names_); }
    /// Prepares the share of rank 0, waits for the others and makes the data set. Throws FileError
    /// if no photo can be used, or if a file cannot be written.
    [[nodiscard]] PrepareOutcome lead();
    /// Prepares the share of another rank.
    void follow();

private:
    void prepare_share();
    /// Prepares and records photos. Returns false, and records none of them, if a signal arrived.
    [[nodiscard]] bool prepare_batch(std::span<const FaceFiles* const> photos);
    [[nodiscard]] std::set<std::string> face_ids(std::span<const std::string> photos) const;
    /// Of faces whose photo is gone since an earlier call.
    void remove_faces_without_photo(const std::set<std::string>& ids) const;

    FolderPreparation folders_;
    const PhotoPreparation& preparation_;
    Ranks& ranks_;
    FolderScan scan_;
    ResultFolder results_;
    std::vector<std::string> names_;  ///< of the photos, relative to their folder
    std::set<std::string> photo_ids_;
    std::vector<const FaceFiles*> waiting_;
};

/// Makes a data set of the photos that have a record (`files`, in output order): corrects a
/// network's poses by their medians, and writes faces.jsonl, camera.json and report.json. If
/// `complete`, these are all photos; then it also writes the contact sheets and removes the
/// records. Otherwise the preparation can continue. `photo_ids` are the ids of all photos, and
/// `left_out` what is none, for report.json. Throws FileError and removes its output if no photo
/// can be used. Returns nothing if there is no face yet, or if a signal arrives before the sheets
/// are written.
[[nodiscard]] std::optional<PrepareReport> write_data_set(const FolderPreparation& folders,
                                                          const PhotoPreparation& preparation,
                                                          std::span<const std::string> files,
                                                          const std::vector<std::string>& photo_ids,
                                                          const std::vector<BrokenFile>& left_out,
                                                          ResultFolder& notes, bool complete);

}  // namespace stymo
