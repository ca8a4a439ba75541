#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

namespace stymo {

/// Whole contents of a file; throws FileError if it cannot be read.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path);
/// The first bytes of a file, at most `count`, for recognising its format; throws FileError if it
/// cannot be read.
[[nodiscard]] std::string read_beginning(const std::filesystem::path& path, std::size_t count);
/// Calls `write(temporary)` and renames the result to `path`, so that `path` is whole or absent.
/// The temporary file keeps path's extension and is removed if `write` throws. Throws FileError if
/// the rename fails.
void write_whole(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path&)>& write);
/// Writes a text with `write_whole`.
void write_text_file(const std::filesystem::path& path, std::string_view text);
/// Flushes a file, or a folder and the files directly in it, to the disk, so that it survives a
/// power cut. Throws FileError if the disk fails.
void flush_to_disk(const std::filesystem::path& path);
/// Creates a folder and its parents; throws FileError if that fails or the folder cannot be written
/// to.
void require_writable_folder(const std::filesystem::path& path);

}  // namespace stymo
