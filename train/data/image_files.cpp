#include "train/data/image_files.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

/// Files with these endings are not opened while a folder is listed, because a data set has many.
constexpr std::array image_endings{".png"sv, ".jpg"sv,  ".jpeg"sv, ".bmp"sv,
                                   ".tif"sv, ".tiff"sv, ".webp"sv};

constexpr std::array passed_over{"@eaDir"sv,   "@Recycle"sv,  "#recycle"sv,
                                 "__MACOSX"sv, "Thumbs.db"sv, "desktop.ini"sv};

/// The first bytes of a format. The reason is empty if the format can be read.
struct Beginning {
    std::string_view bytes;
    std::string_view reason;
};

constexpr std::string_view video = "a video";
constexpr std::string_view archive = "an archive; unpack it and give the folder";
constexpr std::string_view jpeg_xl = "JPEG XL is not read; save it as JPEG or PNG";

constexpr std::array beginnings{Beginning{"\x89PNG\r\n"sv, ""},
                                Beginning{"\xff\xd8\xff"sv, ""},
                                Beginning{"GIF8"sv, ""},
                                Beginning{"II*\0"sv, ""},  // TIFF, and raw photos such as DNG
                                Beginning{"MM\0*"sv, ""},
                                Beginning{"II+\0"sv, ""},
                                Beginning{"MM\0+"sv, ""},
                                Beginning{"\0\0\0\x0cjP  "sv, ""},
                                Beginning{"\xff\x4f\xff\x51"sv, ""},
                                Beginning{"v/1\x01"sv, ""},  // EXR
                                Beginning{"#?RADIANCE"sv, ""},
                                Beginning{"#?RGBE"sv, ""},
                                Beginning{"8BPS"sv, ""},
                                Beginning{"DDS "sv, ""},
                                Beginning{"FUJIFILMCCD-RAW"sv, ""},
                                Beginning{"IIU\0"sv, ""},  // Panasonic
                                Beginning{"IIRO"sv, ""},   // Olympus
                                Beginning{"IIRS"sv, ""},
                                Beginning{"\0\0\0\x0cJXL "sv, jpeg_xl},
                                Beginning{"\xff\x0a"sv, jpeg_xl},
                                Beginning{"\x1a\x45\xdf\xa3"sv, video},
                                Beginning{"PK\x03\x04"sv, archive},
                                Beginning{"\x1f\x8b"sv, archive},
                                Beginning{"7z\xbc\xaf"sv, archive},
                                Beginning{"Rar!"sv, archive}};

/// HEIF and AVIF, Canon's raw photos, and films, all of which begin with the names of their kinds.
std::string_view reason_against_brands(std::string_view bytes) {
    constexpr std::array brands{"heic"sv, "heix"sv, "hevc"sv, "heim"sv, "heis"sv,
                                "mif1"sv, "msf1"sv, "avif"sv, "avis"sv, "crx "sv};
    constexpr std::size_t brand_length = 4;
    for (std::size_t at = 2 * brand_length; at + brand_length <= bytes.size(); at += brand_length)
        if (std::ranges::find(brands, bytes.substr(at, brand_length)) != brands.end()) return "";
    return video;
}

/// One folder after the other, all real ones before links to them.
class ImageSearch {
public:
    explicit ImageSearch(const std::function<bool(const fs::path&)>& is_side) : is_side_(is_side) {}

    void visit_all(const fs::path& folder) {
        visit(folder, true);
        for (std::size_t i = 0; i < links_.size(); ++i) visit(fs::path(links_[i]), false);
    }

    [[nodiscard]] ImageFiles result() && {
        std::ranges::sort(files_.images);
        std::ranges::sort(files_.recognised);
        return std::move(files_);
    }

private:
    void visit(const fs::path& folder, bool is_top) {
        const auto [former, added] = visited_.emplace(fs::canonical(folder), folder);
        if (!added) {
            leave_out(folder, "a link to a folder that is listed as " + former->second.string());
            return;
        }
        std::vector<fs::directory_entry> entries(fs::directory_iterator(folder), {});
        std::ranges::sort(entries, {},
                          [](const fs::directory_entry& entry) { return entry.path(); });
        for (const fs::directory_entry& entry : entries) {
            const std::string name = entry.path().filename().string();
            if (name.starts_with('.') ||
                std::ranges::find(passed_over, name) != passed_over.end() ||
                (is_top && is_side_ && is_side_(name)))
                continue;
            judge(entry);
        }
    }

    void judge(const fs::directory_entry& entry) {
        if (!is_utf8(entry.path().filename().string()))
            return leave_out(entry.path(), "its name is not UTF-8; rename it");
        std::error_code error;
        const fs::file_type type = entry.status(error).type();
        if (type == fs::file_type::not_found) return leave_out(entry.path(), "a link to nothing");
        if (type == fs::file_type::none) return leave_out(entry.path(), error.message());
        if (type == fs::file_type::directory) {
            if (!entry.is_symlink()) return visit(entry.path(), false);
            links_.push_back(entry.path());
            return;
        }
        if (type != fs::file_type::regular) return leave_out(entry.path(), "not a file");
        std::string ending = entry.path().extension().string();
        std::ranges::transform(ending, ending.begin(), [](unsigned char letter) {
            return static_cast<char>(std::tolower(letter));
        });
        if (std::ranges::find(image_endings, ending) == image_endings.end()) {
            std::string reason = reason_against(entry.path());
            if (!reason.empty()) return leave_out(entry.path(), std::move(reason));
            files_.recognised.push_back(entry.path());
        }
        files_.images.push_back(entry.path());
    }
    void leave_out(const fs::path& path, std::string reason) {
        files_.left_out.push_back({path.string(), std::move(reason)});
    }

    const std::function<bool(const fs::path&)>& is_side_;
    std::map<fs::path, fs::path> visited_;  ///< by canonical path
    std::vector<fs::path> links_;           ///< to folders, in the order in which they were found
    ImageFiles files_;
};

}  // namespace

std::string reason_against(const fs::path& file) {
    constexpr std::size_t enough = 64;
    std::string bytes;
    try {
        bytes = read_beginning(file, enough);
    } catch (const FileError&) {
        return "cannot be read";
    }
    const std::string_view first = bytes;
    if (first.empty()) return "not an image (zero bytes)";
    if (first.substr(0, 8).ends_with("ftyp")) return std::string(reason_against_brands(first));
    if (first.starts_with("RIFF") && first.substr(0, 12).ends_with("WEBP")) return {};
    if (first.starts_with("RIFF") && first.substr(0, 12).ends_with("AVI "))
        return std::string(video);
    const bool is_pnm = first.size() > 2 && first[0] == 'P' && first[1] >= '1' && first[1] <= '7' &&
                        std::isspace(static_cast<unsigned char>(first[2])) != 0;
    if (is_pnm) return {};
    for (const auto& [beginning, reason] : beginnings)
        if (first.starts_with(beginning)) return std::string(reason);
    return "not an image";
}

ImageFiles images_below(const fs::path& folder,
                        const std::function<bool(const fs::path& name)>& is_side) {
    ImageSearch search(is_side);
    search.visit_all(folder);
    return std::move(search).result();
}

std::string left_out_text(std::span<const BrokenFile> left_out) {
    constexpr std::size_t names = 3;
    std::map<std::string_view, std::vector<std::string_view>> by_reason;
    for (const BrokenFile& item : left_out) by_reason[item.reason].push_back(item.file);
    std::ostringstream text;
    for (const auto& [reason, files] : by_reason) {
        text << (text.tellp() > 0 ? "\n" : "") << "left out " << files.size()
             << (files.size() == 1 ? " file (" : " files (") << reason << "): ";
        for (std::size_t i = 0; i < std::min(names, files.size()); ++i)
            text << (i == 0 ? "" : ", ") << files[i];
        if (files.size() > names) text << " and " << files.size() - names << " more";
    }
    return text.str();
}

}  // namespace stymo
