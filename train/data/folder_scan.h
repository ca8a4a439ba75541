#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "render/camera.h"
#include "train/data/face_records.h"
#include "train/data/image_files.h"

namespace stymo {

/// The files of one face. Any of the three kinds of mask may be missing.
struct FaceFiles {
    std::string id;  ///< the image's file stem, or its path in the folder (`scan_folder`)
    std::filesystem::path image;
    std::filesystem::path mask;     ///< 8-bit head mask, or empty
    std::filesystem::path parsing;  ///< class map with CelebAMask-HQ's indices, or empty
    /// One mask for each part of the head, the format in which CelebAMask-HQ is distributed.
    std::vector<std::filesystem::path> mask_parts;
    /// White where nothing is known of the face (nn/known_pixels.h), or empty.
    std::filesystem::path unknown{};
};

/// The files of a data set's folder; images are not decoded.
struct FolderScan {
    std::vector<FaceFiles> faces;  ///< in the order of `id_less`
    FaceRecords records;           ///< of `faces.jsonl`; empty without that file
    Intrinsics intrinsics;         ///< of `camera.json`, or the default
    /// The ids of all photos from which the folder was prepared, in the same order, including those
    /// without a usable face: "photos" of `report.json`. Empty without that file.
    std::vector<std::string> photo_ids;
    std::vector<BrokenFile> left_out;  ///< what is no image, or the second one of a photo
};

/// The order of ids: numbers by value ("2" before "10"), then all other names.
[[nodiscard]] bool id_less(const std::string& a, const std::string& b);

/// Where scan_folder looks for images: a folder of images in the folder, or that itself.
[[nodiscard]] std::filesystem::path image_folder(const std::filesystem::path& folder);

/// Lists a folder in the FFHQ format: images (image_files.h) below `images1024x1024`, else
/// `images`, else CelebAMask-HQ's `CelebA-HQ-img`, else anywhere in the folder except in `masks`,
/// `parsing` and `unknown`; and next to them `masks/ID.png`, `parsing/ID.png`, `unknown/ID.png`,
/// CelebAMask-HQ's own `CelebAMask-HQ-mask-anno` (one file for each part), `faces.jsonl`,
/// `camera.json`, EG3D's `dataset.json` and `report.json`, each optional.
///
/// An id is the stem of the image's file. If images in different folders have the same stem, or the
/// ids of `faces.jsonl` have folders, all ids are paths: "person/0001". Of a photo in two formats,
/// such as IMG_1.HEIC and IMG_1.JPG, the one with a usual ending is taken. Poses of `dataset.json`
/// are for images without a pose in `faces.jsonl`; they keep the size of the head at the folder's
/// focal length. Throws FileError for a folder that is missing or has no image, for an id that
/// occurs twice, and for a malformed side file.
[[nodiscard]] FolderScan scan_folder(const std::filesystem::path& folder);

}  // namespace stymo
