#include "train/checkpoint_folder.h"

#include <charconv>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view unfinished = ".unfinished";
constexpr std::string_view replaced = ".replaced";

fs::path with_suffix(fs::path folder, std::string_view suffix) {
    folder += suffix;
    return folder;
}

void rename_or_fail(const fs::path& from, const fs::path& to, const fs::path& folder) {
    std::error_code error;
    fs::rename(from, to, error);
    if (error) fail<FileError>(folder.string(), ": cannot be written (", error.message(), ")");
}

void remove_or_fail(const fs::path& folder) {
    std::error_code error;
    fs::remove_all(folder, error);
    if (error) fail<FileError>(folder.string(), ": cannot be removed (", error.message(), ")");
}

}  // namespace

std::optional<std::int64_t> checkpoint_step(const fs::path& folder) {
    const std::string name = folder.filename().string();
    std::int64_t step = 0;
    const auto end = std::from_chars(name.data(), name.data() + name.size(), step);
    if (end.ec != std::errc{} || end.ptr != name.data() + name.size()) return std::nullopt;
    return step;
}

void write_checkpoint_folder(const fs::path& folder,
                             const std::function<void(const fs::path&)>& write) {
    repair_checkpoint_folder(folder);
    const fs::path source = with_suffix(folder, unfinished);
    remove_or_fail(source);
    require_writable_folder(source);
    write(source);
    flush_to_disk(source);
    const fs::path older = with_suffix(folder, replaced);
    if (fs::exists(folder)) rename_or_fail(folder, older, folder);
    try {
        rename_or_fail(source, folder, folder);
    } catch (const FileError&) {
        repair_checkpoint_folder(folder);
        throw;
    }
    flush_names(fs::absolute(folder).parent_path());
    remove_or_fail(older);
}

void remove_checkpoint_folder(const fs::path& folder) {
    const fs::path leaving = with_suffix(folder, unfinished);
    remove_or_fail(leaving);
    rename_or_fail(folder, leaving, folder);
    flush_names(fs::absolute(folder).parent_path());
    remove_or_fail(leaving);
}

void repair_checkpoint_folder(const fs::path& folder) {
    const fs::path older = with_suffix(folder, replaced);
    if (!fs::exists(older)) return;
    if (fs::exists(folder)) {
        remove_or_fail(older);
    } else {
        rename_or_fail(older, folder, folder);
    }
}

void repair_checkpoint_folders(const fs::path& folder) {
    // Listed before any change, because a directory iterator may or may not show entries that are
    // renamed meanwhile.
    const std::vector<fs::directory_entry> entries{fs::directory_iterator(folder),
                                                   fs::directory_iterator()};
    for (const fs::directory_entry& entry : entries) {
        fs::path path = entry.path();
        if (path.extension() == unfinished) remove_or_fail(path);
        if (path.extension() == replaced) repair_checkpoint_folder(path.replace_extension());
    }
}

}  // namespace stymo
