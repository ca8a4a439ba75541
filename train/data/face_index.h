#pragma once

#include <filesystem>
#include <optional>

#include "train/data/face_records.h"

namespace stymo {

/// Size and time of a file, by which the index detects changes.
struct FileVersion {
    std::int64_t size = 0;
    std::int64_t time = 0;  ///< time of the last change in the clock of the file system

    bool operator==(const FileVersion&) const = default;
};

/// Throws std::filesystem::filesystem_error if there is no such file.
[[nodiscard]] FileVersion version_of(const std::filesystem::path& file);

/// The path of the index, `faces.jsonl.index`. It has a line with the version of the file and a
/// checksum, and for each face a line with offset, size, flags for code and landmarks, pose,
/// id, person, series and source.
[[nodiscard]] std::filesystem::path index_path(const std::filesystem::path& file);
/// Reads the index; nothing if it is missing, damaged or belongs to another version of the file.
[[nodiscard]] std::optional<FaceEntries> read_face_index(const std::filesystem::path& file,
                                                         const FileVersion& version);
/// Writes the index. Does nothing if it cannot be written, or if an id contains a tab or a
/// line break.
void write_face_index(const std::filesystem::path& file, const FileVersion& version,
                      const FaceEntries& entries);

}  // namespace stymo
