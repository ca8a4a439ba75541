#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "apps/prep/photo_outcome.h"

namespace stymo {

/// What a folder in preparation knows of the photos that are done: `progress.jsonl`, the settings in its first line, then one
/// photo a line. It goes away when the folder is complete.
class ProgressFile {
public:
    /// Goes on with the file in `folder`, or begins one. A line that a crash cut off is dropped. Throws FileError if the file was
    /// begun with other settings (an object of texts, numbers and truth values, named as the command line does), is malformed or
    /// cannot be written.
    ProgressFile(const std::filesystem::path& folder, const JsonValue& settings);

    [[nodiscard]] static std::filesystem::path path_in(const std::filesystem::path& folder);

    [[nodiscard]] bool contains(const std::string& file) const { return lines_.contains(file); }
    [[nodiscard]] PhotoOutcome read(const std::string& file) const;
    /// On the disk when it returns.
    void append(const PhotoOutcome& outcome);

private:
    void begin(const JsonValue& settings);
    void go_on(const std::string& settings);

    std::filesystem::path path_;
    std::map<std::string, std::streamoff> lines_;
    std::ofstream stream_;
};

}  // namespace stymo
