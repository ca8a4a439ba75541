#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace stymo {

/// Checks the settings of an interrupted job in `folder` that is to be continued. `begun` and
/// `wanted` are JSON objects of strings, numbers and booleans with the names of command-line
/// options. Throws FileError that names the first difference.
void require_same_settings(const std::filesystem::path& folder, const std::string& begun,
                           const std::string& wanted);

/// Calls `visit` with each whole line of a file that results are appended to, its number from 1 on,
/// and its offset in bytes. A last line that a crash cut off is removed from the file. What `visit`
/// throws becomes a FileError that names file and line. A file that does not exist has no lines.
void visit_whole_lines(
    const std::filesystem::path& file,
    const std::function<void(const std::string& line, int number, std::int64_t offset)>& visit);

}  // namespace stymo
