#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "core/io/json_writer.h"

namespace stymo {

/// Compares the settings with which a job in `folder` was begun with those that should continue it.
/// Both are JSON objects of strings, numbers and booleans with the names of command-line options.
/// Throws FileError, which names the first difference.
void require_same_settings(const std::filesystem::path& folder, const std::string& begun,
                           const std::string& wanted);

/// Begins a job in `folder` by writing its settings.json, or continues one that has the same, as
/// `require_same_settings` says. Throws FileError for a folder that holds `results` but no
/// settings.json, or cannot be written.
void begin_or_continue(const std::filesystem::path& folder, const JsonValue& settings,
                       const std::string& results);

/// A file's absolute name and checksum, for the settings of a job that reads it.
[[nodiscard]] std::string with_checksum(const std::filesystem::path& file);

/// Calls `visit` with each complete line of a file to which results are appended, its number (from
/// 1) and its offset in bytes. A partial last line, which a crash leaves, is removed from the file.
/// Exceptions of `visit` become a FileError that names file and line. A file that does not exist
/// has no lines.
void visit_whole_lines(
    const std::filesystem::path& file,
    const std::function<void(const std::string& line, int number, std::int64_t offset)>& visit);

}  // namespace stymo
