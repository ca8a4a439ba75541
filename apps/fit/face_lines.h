#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>

#include "core/io/json_writer.h"

namespace stymo {

/// The results of a folder of photos, one JSON object a line with the members "file" and, for a
/// photo that cannot be used, "failure". Rank 0 appends to `faces.jsonl`, rank R to
/// `faces.R.jsonl`, so that ranks do not write to one file and one that dies loses no line.
class FaceLines {
public:
    /// Reads the lines of all ranks. Throws FileError for a line that is no such object.
    FaceLines(std::filesystem::path folder, int rank);

    [[nodiscard]] bool contains(const std::string& file) const { return lines_.contains(file); }
    /// Why a photo with a line cannot be used; empty if it can.
    [[nodiscard]] const std::string& failure_of(const std::string& file) const {
        return lines_.at(file).failure;
    }
    /// Adds a line, which is on the disk when this function returns.
    void append(const JsonValue& line) const;
    /// Joins the lines of all ranks, which must have ended, in `faces.jsonl` in the order of
    /// `files`.
    void join(std::span<const std::string> files);

private:
    struct Line {
        std::filesystem::path path;
        std::int64_t offset;
        std::string failure;
    };
    void read();

    std::filesystem::path folder_;
    std::filesystem::path own_;
    std::map<std::string, Line> lines_;
};

}  // namespace stymo
