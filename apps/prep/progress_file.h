#pragma once

#include <cstdint>
#include <filesystem>
#include <ios>
#include <map>
#include <string>

#include "apps/prep/photo_outcome.h"

namespace stymo {

/// The records of the finished photos of a folder in preparation: `progress.jsonl`, with the
/// settings in the first line and one photo in each further line. It is removed when the folder is
/// complete.
class ProgressFile {
public:
    /// Continues the file in `folder`, or begins one. `settings` is an object of strings, numbers
    /// and booleans with the names of command-line options. A partial last line, which a crash
    /// leaves, is dropped. Throws FileError if the file was begun with other settings, is malformed
    /// or cannot be written.
    ProgressFile(const std::filesystem::path& folder, const JsonValue& settings);

    [[nodiscard]] static std::filesystem::path path_in(const std::filesystem::path& folder);

    [[nodiscard]] bool contains(const std::string& file) const { return lines_.contains(file); }
    [[nodiscard]] PhotoOutcome read(const std::string& file) const;
    /// Adds a record. It is on the disk when this function returns.
    void append(const PhotoOutcome& outcome);

private:
    std::filesystem::path path_;
    std::map<std::string, std::streamoff> lines_;
};

}  // namespace stymo
