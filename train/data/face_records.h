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

/// What is in memory of a line.
struct FaceEntry {
    std::int64_t offset = 0;  ///< of the line in the file
    std::int64_t size = 0;
    bool has_code = false;
    bool has_landmarks = false;
    std::optional<Pose> pose{};
};

using FaceEntries = std::map<std::string, FaceEntry>;

/// The lines of a `faces.jsonl`. Codes and landmarks stay in the file until they are asked for, so
/// that the list of a million faces fits into memory. Listing such a file takes minutes; the next
/// time the index beside it (face_index.h) is read instead, as long as the file has not changed.
class FaceRecords {
public:
    /// Smaller files get no index.
    static constexpr std::int64_t usual_index_from = std::int64_t{1} << 26;

    /// None.
    FaceRecords() = default;
    /// Throws FileError with file and line number for a line that is no record and for an id that
    /// comes twice. A folder that cannot be written to gets no index.
    explicit FaceRecords(const std::filesystem::path& file,
                         std::int64_t index_from = usual_index_from);

    [[nodiscard]] std::int64_t size() const { return std::ssize(entries_); }
    /// Null for a face without a line.
    [[nodiscard]] const FaceEntry* find(const std::string& id) const;
    /// Reads a face's line; empty without one. Throws FileError if the file has changed.
    [[nodiscard]] FaceRecord read(const std::string& id) const;

private:
    std::filesystem::path path_;
    std::optional<OpenFile> file_;
    FaceEntries entries_;
};

}  // namespace stymo
