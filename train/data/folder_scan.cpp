#include "train/data/folder_scan.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "render/camera_matrices.h"
#include "train/data/folder_records.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 14> head_parts{"skin",  "l_brow", "r_brow", "l_eye", "r_eye",
                                                      "eye_g", "l_ear",  "r_ear",  "ear_r", "nose",
                                                      "mouth", "u_lip",  "l_lip",  "hair"};
constexpr const char* celeba_images = "CelebA-HQ-img";
constexpr std::string_view celeba_masks = "CelebAMask-HQ-mask-anno";
constexpr std::array<const char*, 3> image_folders{"images1024x1024", "images", celeba_images};

bool is_side(const fs::path& name) {
    constexpr std::array<std::string_view, 9> names{
        "masks",       "parsing",     "unknown",
        celeba_masks,  "faces.jsonl", "faces.jsonl.index",
        "camera.json", "report.json", "dataset.json"};
    return std::ranges::find(names, name.string()) != names.end();
}

using PathById = std::map<std::string, fs::path>;

/// How the images of a folder are named.
enum class Naming { stems, paths };

std::string id_of(const fs::path& image, const fs::path& root, Naming naming) {
    return naming == Naming::stems
               ? image.stem().string()
               : image.lexically_relative(root).replace_extension().generic_string();
}

Naming naming_of(const std::vector<fs::path>& images, const fs::path& root,
                 const FaceRecords& records) {
    std::map<std::string, fs::path> folders;
    for (const fs::path& image : images) {
        const fs::path folder = image.parent_path();
        const auto& [stem, former] = *folders.emplace(image.stem().string(), folder).first;
        if (folder != former ||
            (folder != root && records.find(id_of(image, root, Naming::paths)) != nullptr))
            return Naming::paths;
    }
    return Naming::stems;
}

/// `files.left_out` gets the images that only their content tells, if another one has their id.
PathById by_id(ImageFiles& files, const fs::path& root, Naming naming) {
    PathById result;
    const auto is_recognised = [&](const fs::path& path) {
        return std::ranges::binary_search(files.recognised, path);
    };
    std::ranges::stable_sort(files.images, {}, is_recognised);
    for (const fs::path& path : files.images) {
        const auto [entry, added] = result.emplace(id_of(path, root, naming), path);
        if (added) continue;
        if (!is_recognised(path))
            fail<FileError>("two images have the id \"", entry->first,
                            "\": ", entry->second.string(), " and ", path.string(),
                            "; rename or remove one");
        files.left_out.push_back({path.string(), "another file of the same name is taken"});
    }
    return result;
}

PathById optional_side_folder(const fs::path& folder, Naming naming) {
    if (!fs::is_directory(folder)) return {};
    ImageFiles files = images_below(folder);
    return by_id(files, folder, naming);
}

bool is_number(std::string_view id) {
    return !id.empty() && std::all_of(id.begin(), id.end(), [](unsigned char letter) {
        return std::isdigit(letter) != 0;
    });
}

std::string_view without_leading_zeros(std::string_view digits) {
    digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
    return digits;
}

/// The masks "00012_hair.png" of the parts that make up a head, under the number without its
/// leading zeros.
std::map<std::string, std::vector<fs::path>> head_parts_by_number(const fs::path& folder) {
    std::map<std::string, std::vector<fs::path>> parts;
    if (!fs::is_directory(folder)) return parts;
    for (const fs::path& path : images_below(folder).images) {
        const std::string stem = path.stem().string();
        const std::size_t underscore = stem.find('_');
        if (underscore == std::string::npos) continue;
        const std::string part = stem.substr(underscore + 1);
        if (std::find(head_parts.begin(), head_parts.end(), part) == head_parts.end()) continue;
        parts[std::string(without_leading_zeros(stem.substr(0, underscore)))].push_back(path);
    }
    return parts;
}

/// Adds the poses of EG3D's `dataset.json`, whose labels name files below `folder`.
void add_eg3d_poses(const fs::path& folder, FolderScan& scan) {
    const fs::path file = folder / "dataset.json";
    if (!fs::exists(file)) return;
    const std::optional<std::map<std::string, Camera>> cameras = read_eg3d_cameras(file);
    if (!cameras) {
        scan.left_out.push_back({file.string(), "its labels are no cameras of EG3D"});
        return;
    }
    for (const FaceFiles& face : scan.faces) {
        const auto found = cameras->find(face.image.lexically_relative(folder).generic_string());
        if (found != cameras->end())
            scan.records.add_pose(
                face.id, pose_from_camera(with_focal(found->second, scan.intrinsics.focal)));
    }
}

/// What is said of a folder in which no image was found.
[[noreturn]] void fail_without_images(const fs::path& root, const ImageFiles& files) {
    std::string others = left_out_text(files.left_out);
    std::ranges::replace(others, '\n', ';');
    fail<FileError>(root.string(),
                    ": no images (png, jpg, heic, avif, webp, tif, raw); give a folder of face "
                    "images",
                    others.empty() ? "" : "; ", others);
}

}  // namespace

fs::path image_folder(const fs::path& folder) {
    for (const char* name : image_folders)
        if (fs::is_directory(folder / name)) return folder / name;
    return folder;
}

bool id_less(const std::string& a, const std::string& b) {
    const bool number_a = is_number(a);
    const bool number_b = is_number(b);
    if (number_a != number_b) return number_a;
    if (!number_a) return a < b;
    const std::string_view digits_a = without_leading_zeros(a);
    const std::string_view digits_b = without_leading_zeros(b);
    if (digits_a.size() != digits_b.size()) return digits_a.size() < digits_b.size();
    return digits_a != digits_b ? digits_a < digits_b : a < b;
}

FolderScan scan_folder(const fs::path& folder) {
    std::error_code unreadable;
    if (!fs::is_directory(folder, unreadable)) {
        const bool is_file = fs::is_regular_file(folder, unreadable);
        const std::string reason = is_file ? reason_against(folder) : "";
        fail<FileError>(folder.string(), is_file ? ": a file" : ": no such folder",
                        reason.empty() ? "" : " (" + reason + ")",
                        "; give a folder of face images");
    }
    try {
        const fs::path root = image_folder(folder);
        // Side files and folders lie beside folders of images, not in them.
        ImageFiles files = root == folder ? images_below(root, is_side) : images_below(root);
        if (files.images.empty()) fail_without_images(root, files);
        FolderScan scan;
        if (fs::exists(folder / "faces.jsonl")) scan.records = FaceRecords(folder / "faces.jsonl");
        const Naming naming = naming_of(files.images, root, scan.records);
        const PathById images = by_id(files, root, naming);
        scan.left_out = std::move(files.left_out);
        const PathById masks = optional_side_folder(folder / "masks", naming);
        const PathById parsing = optional_side_folder(folder / "parsing", naming);
        const PathById unknown = optional_side_folder(folder / "unknown", naming);
        const auto parts = head_parts_by_number(folder / celeba_masks);

        for (const auto& [id, image] : images) {
            FaceFiles face{id, image, {}, {}, {}, {}};
            if (const auto mask = masks.find(id); mask != masks.end()) face.mask = mask->second;
            if (const auto map = parsing.find(id); map != parsing.end()) face.parsing = map->second;
            if (const auto map = unknown.find(id); map != unknown.end()) face.unknown = map->second;
            if (const auto found = parts.find(std::string(without_leading_zeros(id)));
                is_number(id) && found != parts.end())
                face.mask_parts = found->second;
            scan.faces.push_back(std::move(face));
        }
        std::ranges::sort(scan.faces, id_less, &FaceFiles::id);
        if (fs::exists(folder / "camera.json"))
            scan.intrinsics = read_intrinsics(folder / "camera.json");
        add_eg3d_poses(folder, scan);
        if (fs::exists(folder / "report.json"))
            scan.photo_ids = read_photo_ids(folder / "report.json");
        std::ranges::sort(scan.photo_ids, id_less);
        return scan;
    } catch (const fs::filesystem_error& error) {
        fail<FileError>(folder.string(), ": cannot be listed: ", error.code().message());
    }
}

}  // namespace stymo
