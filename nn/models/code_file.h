#pragma once

#include <filesystem>
#include <string>

#include "nn/models/codes.h"
#include "render/camera.h"

namespace stymo {

/// One face as `codes.json` holds it: {"code": {"id": [100], "expr": [79], "tex": [100], "light":
/// [27]}, "pose": {"yaw_deg", "pitch_deg", "roll_deg", "t": [x, y, z]}}.
struct CodeFile {
    Codes codes;  ///< one row, in Z
    Pose pose;
};

/// Throws FileError naming the file and the key that is missing, of another length or not a number.
[[nodiscard]] CodeFile read_code_file(const std::filesystem::path& path);
/// The same of the text of such a file; `source` is its name in errors.
[[nodiscard]] CodeFile parse_code_file(const std::string& text, const std::string& source);
/// The pose alone, of a code file or of any JSON object with such a "pose".
[[nodiscard]] Pose read_pose(const std::filesystem::path& path);
/// Row `index` of the codes, as the text of such a file.
[[nodiscard]] std::string code_file_text(const Codes& codes, std::int64_t index, const Pose& pose);
/// Writes that text. Whole or not at all.
void write_code_file(const std::filesystem::path& path, const Codes& codes, std::int64_t index,
                     const Pose& pose);

}  // namespace stymo
