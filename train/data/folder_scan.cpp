#include "train/data/folder_scan.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <string_view>

#include "core/error.h"
#include "train/data/folder_records.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 7> image_extensions{".png", ".jpg",  ".jpeg", ".bmp",
                                                           ".tif", ".tiff", ".webp"};
constexpr std::array<std::string_view, 14> head_parts{"skin",  "l_brow", "r_brow", "l_eye", "r_eye",
                                                      "eye_g", "l_ear",  "r_ear",  "ear_r", "nose",
                                                      "mouth", "u_lip",  "l_lip",  "hair"};
constexpr const char* celeba_images = "CelebA-HQ-img";
constexpr const char* celeba_masks = "CelebAMask-HQ-mask-anno";
constexpr std::array<const char*, 3> image_folders{"images1024x1024", "images", celeba_images};

bool is_image(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
    return std::find(image_extensions.begin(), image_extensions.end(), extension) !=
           image_extensions.end();
}

bool is_side_folder(const fs::path& name) {
    return name == "masks" || name == "parsing" || name == celeba_masks ||
           name.string().starts_with('.');
}

/// All images below `folder`, without those in its side folders. They are sorted, because the order
/// in which a file system lists them is its own.
std::vector<fs::path> images_below(const fs::path& folder) {
    std::vector<fs::path> images;
    for (auto entry = fs::recursive_directory_iterator(folder);
         entry != fs::recursive_directory_iterator(); ++entry) {
        const bool hidden = entry->path().filename().string().starts_with('.');
        if (entry->is_directory()) {
            if (hidden || (entry.depth() == 0 && is_side_folder(entry->path().filename())))
                entry.disable_recursion_pending();
        } else if (!hidden && entry->is_regular_file() && is_image(entry->path())) {
            images.push_back(entry->path());
        }
    }
    std::ranges::sort(images);
    return images;
}

fs::path image_folder(const fs::path& folder) {
    for (const char* name : image_folders)
        if (fs::is_directory(folder / name)) return folder / name;
    return folder;
}

using PathById = std::map<std::string, fs::path>;

PathById by_id(const std::vector<fs::path>& images) {
    PathById result;
    for (const fs::path& path : images) {
        const auto [entry, added] = result.emplace(path.stem().string(), path);
        if (!added)
            fail<FileError>("two images have the id \"", entry->first,
                            "\": ", entry->second.string(), " and ", path.string(),
                            "; rename or remove one");
    }
    return result;
}

PathById optional_side_folder(const fs::path& folder) {
    return fs::is_directory(folder) ? by_id(images_below(folder)) : PathById{};
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
    for (const fs::path& path : images_below(folder)) {
        const std::string stem = path.stem().string();
        const std::size_t underscore = stem.find('_');
        if (underscore == std::string::npos) continue;
        const std::string part = stem.substr(underscore + 1);
        if (std::find(head_parts.begin(), head_parts.end(), part) == head_parts.end()) continue;
        parts[std::string(without_leading_zeros(stem.substr(0, underscore)))].push_back(path);
    }
    return parts;
}

}  // namespace

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
    if (!fs::is_directory(folder))
        fail<FileError>(folder.string(), ": no such folder; give a folder of face images");
    try {
        const fs::path root = image_folder(folder);
        const PathById images = by_id(images_below(root));
        if (images.empty())
            fail<FileError>(root.string(),
                            ": no images (png, jpg, bmp, tif, webp); give a folder of face images");
        const PathById masks = optional_side_folder(folder / "masks");
        const PathById parsing = optional_side_folder(folder / "parsing");
        const auto parts = head_parts_by_number(folder / celeba_masks);

        FolderScan scan;
        for (const auto& [id, image] : images) {
            FaceFiles files{id, image, {}, {}, {}};
            if (const auto mask = masks.find(id); mask != masks.end()) files.mask = mask->second;
            if (const auto map = parsing.find(id); map != parsing.end())
                files.parsing = map->second;
            if (const auto found = parts.find(std::string(without_leading_zeros(id)));
                is_number(id) && found != parts.end())
                files.mask_parts = found->second;
            scan.faces.push_back(std::move(files));
        }
        std::ranges::sort(scan.faces, id_less, &FaceFiles::id);
        if (fs::exists(folder / "faces.jsonl")) scan.records = FaceRecords(folder / "faces.jsonl");
        if (fs::exists(folder / "camera.json"))
            scan.intrinsics = read_intrinsics(folder / "camera.json");
        if (fs::exists(folder / "report.json"))
            scan.photo_ids = read_photo_ids(folder / "report.json");
        std::ranges::sort(scan.photo_ids, id_less);
        return scan;
    } catch (const fs::filesystem_error& error) {
        fail<FileError>(folder.string(), ": cannot be listed: ", error.code().message());
    }
}

}  // namespace stymo
