#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "render/camera.h"
#include "train/folder_records.h"

namespace stymo {

/// Where the picture and the masks of one face are found; of the three kinds of mask any may be missing.
struct FaceFiles {
    std::string id;  ///< the picture's file stem
    std::filesystem::path image;
    std::filesystem::path mask;                     ///< 8-bit head mask, or empty
    std::filesystem::path parsing;                  ///< class map with CelebAMask-HQ's indices, or empty
    std::vector<std::filesystem::path> mask_parts;  ///< one mask for each part of the head, as CelebAMask-HQ is distributed
};

/// A data set's folder: what is there, nothing decoded yet.
struct FolderScan {
    std::vector<FaceFiles> faces;               ///< in order of id: numbers by value, then names by letter
    std::map<std::string, FaceRecord> records;  ///< of `faces.jsonl`, empty without that file
    Intrinsics intrinsics;                      ///< of `camera.json`, or the default
};

/// Lists a folder in the FFHQ format: pictures (png, jpg, jpeg, bmp, tif, tiff, webp) below `images1024x1024`, else `images`,
/// else CelebAMask-HQ's `CelebA-HQ-img`, else anywhere in the folder but in `masks` and `parsing`; and beside them
/// `masks/ID.png`, `parsing/ID.png`, CelebAMask-HQ's own `CelebAMask-HQ-mask-anno` (one file for each part), `faces.jsonl` and
/// `camera.json`, each optional. Throws FileError for a folder that is missing or has no picture, for an id that comes twice, and
/// for a malformed side file.
[[nodiscard]] FolderScan scan_folder(const std::filesystem::path& folder);

}  // namespace stymo
