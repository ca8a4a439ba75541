#pragma once

#include <filesystem>
#include <optional>

#include "train/data/face_records.h"

namespace stymo {

/// Size and time of a file, by which its index knows it.
struct FileVersion {
    std::int64_t size = 0;
    std::int64_t time = 0;  ///< of the last change, in the clock of the file system

    bool operator==(const FileVersion&) const = default;
};

/// Throws std::filesystem::filesystem_error if there is no such file.
[[nodiscard]] FileVersion version_of(const std::filesystem::path& file);

/// `faces.jsonl.index`: a line with the version of the file and a checksum, and one for each face:
/// offset, size, what it has, pose and id.
[[nodiscard]] std::filesystem::path index_path(const std::filesystem::path& file);
/// Nothing if the index is missing, damaged or that of another version of the file.
[[nodiscard]] std::optional<FaceEntries> read_face_index(const std::filesystem::path& file,
                                                         const FileVersion& version);
/// Does nothing where it cannot be written, or where an id has a line break.
void write_face_index(const std::filesystem::path& file, const FileVersion& version,
                      const FaceEntries& entries);

}  // namespace stymo
