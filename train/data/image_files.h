#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace stymo {

/// A file that cannot be used, and the reason.
struct BrokenFile {
    std::string file;
    std::string reason;
};

/// The images below a folder, sorted, and what lies among them.
struct ImageFiles {
    std::vector<std::filesystem::path> images;
    /// Those that were recognised by their content alone: HEIC, AVIF, raw photos, any ending.
    std::vector<std::filesystem::path> recognised;
    std::vector<BrokenFile> left_out;
};

/// Lists the images below a folder. A file is an image by its usual ending (png, jpg, jpeg, bmp,
/// tif, tiff, webp), or else by its first bytes. Links to folders are followed; a folder that is
/// reached twice is listed once. Passed over without a word are hidden files and what storage
/// devices and file managers add (`@eaDir`, `Thumbs.db`). Names that are not UTF-8 are left out,
/// because results name photos in JSON. `is_side` says which names directly in
/// the folder are none of the photos. Throws std::filesystem::filesystem_error.
[[nodiscard]] ImageFiles images_below(
    const std::filesystem::path& folder,
    const std::function<bool(const std::filesystem::path& name)>& is_side = {});

/// Why a file is no image that can be read, judged by its first bytes; empty for an image.
[[nodiscard]] std::string reason_against(const std::filesystem::path& file);

/// One line for each reason, with the number of files and the first names; empty without any.
[[nodiscard]] std::string left_out_text(std::span<const BrokenFile> left_out);

}  // namespace stymo
