#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace stymo {

/// Whole contents of a file; throws FileError if it cannot be read.
[[nodiscard]] std::string read_file(const std::filesystem::path& path);
/// Calls `visit` with the contents of a file, part by part; throws FileError if it cannot be read.
void read_parts(const std::filesystem::path& path,
                const std::function<void(std::string_view part)>& visit);
/// The first bytes of a file, at most `count`, for recognising its format; throws FileError if it
/// cannot be read.
[[nodiscard]] std::string read_beginning(const std::filesystem::path& path, std::size_t count);
/// A file whose parts can be read by several threads at once. It stays readable when another file
/// replaces it.
class OpenFile {
public:
    /// Throws FileError if it cannot be opened.
    explicit OpenFile(const std::filesystem::path& path);
    /// Throws FileError if the file ends before `offset` + `size` or cannot be read.
    [[nodiscard]] std::string read(std::int64_t offset, std::int64_t size) const;

private:
    struct Implementation;
    std::shared_ptr<const Implementation> implementation_;
};

/// Tells the operating system that a file will be read soon, so that it can read ahead. A missing
/// file is ignored.
void prefetch(const std::filesystem::path& path);
/// Whether a written file survives a crash of the system or a power cut. A program that is killed
/// never leaves a partial file in either case.
enum class Durability {
    crash_safe,  ///< the file is on the disk when the function returns; a crash before that leaves
                 ///< the old file
    none,        ///< the file may be empty after a crash: for images and reports, which can be made
                 ///< again
};

/// Digits and hyphens that no other write has in its temporary name: not of another thread, nor of
/// another machine that shares the folder, where a process may have the same number.
[[nodiscard]] std::string name_of_this_write();
/// Calls `write(temporary)` and renames the result to `path`, so that `path` is never partial. The
/// temporary file keeps path's extension and is removed if `write` throws. Throws FileError if
/// flushing or renaming fails.
void write_whole(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path&)>& write,
                 Durability durability = Durability::crash_safe);
/// Writes these bytes with `write_whole`.
void write_file(const std::filesystem::path& path, std::string_view text,
                Durability durability = Durability::crash_safe);
/// Removes temporary files that killed processes left in a folder. No other process may be writing
/// there.
void remove_temporary_files(const std::filesystem::path& folder);
/// Appends a line and a line break to a file, which is created if it is missing. Throws FileError
/// if that fails, and removes the part of the line that was written, for which no other process may
/// append to the file meanwhile. A crash of the system can
/// still leave a partial line.
void append_line(const std::filesystem::path& path, std::string_view line, Durability durability);
/// Flushes a file, or a folder with everything in it, to the disk. Throws FileError if the disk
/// fails.
void flush_to_disk(const std::filesystem::path& path);
/// Flushes a folder's directory entries to the disk: files that were made, renamed or removed.
/// Throws FileError if the disk fails.
void flush_names(const std::filesystem::path& folder);
/// Creates a folder and its parents, and flushes them to the disk. Throws FileError if that fails
/// or the folder cannot be written to.
void require_writable_folder(const std::filesystem::path& path);

}  // namespace stymo
