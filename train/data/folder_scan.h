#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render/camera.h"
#include "train/data/face_records.h"

namespace stymo {

/// The files of one face. Any of the three kinds of mask may be missing.
struct FaceFiles {
    std::string id;  ///< the image's file stem
    std::filesystem::path image;
    std::filesystem::path mask;     ///< 8-bit head mask, or empty
    std::filesystem::path parsing;  ///< class map with CelebAMask-HQ's indices, or empty
    std::vector<std::filesystem::path>
        mask_parts;  ///< one mask for each part of the head, as CelebAMask-HQ is distributed
};

/// The files of a data set's folder, not decoded yet.
struct FolderScan {
    std::vector<FaceFiles> faces;  ///< in order of id: numbers by value, then names by letter
    FaceRecords records;           ///< of `faces.jsonl`, none without that file
    Intrinsics intrinsics;         ///< of `camera.json`, or the default
    /// In the same order, the ids of all photos that the folder was prepared from, also of those
    /// without a usable face: "photos" of `report.json`; empty if that is not there.
    std::vector<std::string> photo_ids;
};

/// The order of ids: numbers by value ("2" before "10") and before all other names.
[[nodiscard]] bool id_less(const std::string& a, const std::string& b);

/// Lists a folder in the FFHQ format: images (png, jpg, jpeg, bmp, tif, tiff, webp) below
/// `images1024x1024`, else `images`, else CelebAMask-HQ's `CelebA-HQ-img`, else anywhere in the
/// folder but in `masks` and `parsing`; and beside them `masks/ID.png`, `parsing/ID.png`,
/// CelebAMask-HQ's own `CelebAMask-HQ-mask-anno` (one file for each part), `faces.jsonl`,
/// `camera.json` and `report.json`, each optional. Throws FileError for a folder that is missing or
/// has no image, for an id that comes twice, and for a malformed side file.
[[nodiscard]] FolderScan scan_folder(const std::filesystem::path& folder);

}  // namespace stymo
