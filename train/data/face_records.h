#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/io/file.h"
#include "render/camera.h"
#include "train/data/folder_records.h"

namespace stymo {

/// The part of a line that is kept in memory.
struct FaceEntry {
    std::int64_t offset = 0;  ///< of the line in the file
    std::int64_t size = 0;
    bool has_code = false;
    bool has_landmarks = false;
    std::optional<Pose> pose{};
    PhotoOrigin origin{};
};

using FaceEntries = std::map<std::string, FaceEntry>;

/// The lines of a `faces.jsonl`. Codes and landmarks are read from the file only when they are
/// needed, so that the list of a million faces fits into memory. Parsing such a file takes minutes.
/// The result is stored in an index next to the file, which is used as long as the
/// file does not change.
class FaceRecords {
public:
    /// Smaller files get no index.
    static constexpr std::int64_t usual_index_from = std::int64_t{1} << 26;

    /// No records.
    FaceRecords() = default;
    /// Reads `file`, or its index. A file of at least `index_from` bytes gets an index, if the
    /// folder can be written to. Throws FileError with file and line number for a line that is not
    /// a record and for an id that occurs twice.
    explicit FaceRecords(const std::filesystem::path& file,
                         std::int64_t index_from = usual_index_from);

    /// Gives a face a pose, unless its line has one. `read` does not return it.
    void add_pose(const std::string& id, const Pose& pose);

    [[nodiscard]] std::int64_t size() const { return std::ssize(entries_); }
    /// Null for a face without a line.
    [[nodiscard]] const FaceEntry* find(const std::string& id) const;
    /// Reads a face's line; an empty record for a face without a line. Throws FileError if the file
    /// has changed.
    [[nodiscard]] FaceRecord read(const std::string& id) const;

private:
    std::filesystem::path path_;
    std::optional<OpenFile> file_;
    FaceEntries entries_;
};

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
/// id, person, series, source and take.
[[nodiscard]] std::filesystem::path index_path(const std::filesystem::path& file);
/// Reads the index; nothing if it is missing, damaged or belongs to another version of the file.
[[nodiscard]] std::optional<FaceEntries> read_face_index(const std::filesystem::path& file,
                                                         const FileVersion& version);
/// Writes the index. Does nothing if it cannot be written, or if an id contains a tab or a
/// line break.
void write_face_index(const std::filesystem::path& file, const FileVersion& version,
                      const FaceEntries& entries);

}  // namespace stymo
