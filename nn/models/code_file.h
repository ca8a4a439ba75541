#pragma once

#include <filesystem>
#include <string>

#include "core/io/json_writer.h"
#include "nn/models/codes.h"
#include "render/camera.h"

namespace stymo {

/// The content of a `codes.json`, one face: {"code": {"id": [100], "expr": [79], "tex": [100],
/// "light": [27]}, "pose": {"yaw_deg", "pitch_deg", "roll_deg", "t": [x, y, z]}}.
struct CodeFile {
    Codes codes;  ///< one row, in Z
    Pose pose;
    std::string model{};  ///< mark of the model that has the codes ("model"); empty: not known
};

/// Throws FileError, which names the file and the key, if a key is missing, has another length or
/// is not numeric.
[[nodiscard]] CodeFile read_code_file(const std::filesystem::path& path);
/// The same for the text of such a file. Error messages name `source` as the file.
[[nodiscard]] CodeFile parse_code_file(const std::string& text, const std::string& source);
/// The metadata of a published or widened model in which the mark of the model before stands.
inline constexpr const char* mark_key = "codes_of";
/// The mark of the model in this file, which its codes carry: that of the model that it was
/// made from, if it renders the same, otherwise a checksum of the file. Throws FileError.
[[nodiscard]] std::string model_mark(const std::filesystem::path& model);
/// Throws FileError, which names `source`, for codes with another mark than this.
void require_mark(const CodeFile& codes, const std::string& mark, const std::string& source);
/// Reads codes of the model with this mark. Throws FileError, too, for codes with another mark.
[[nodiscard]] CodeFile read_code_file(const std::filesystem::path& path, const std::string& mark);
/// Reads only the pose, from a code file or from any JSON object with such a "pose". Throws
/// FileError.
[[nodiscard]] Pose read_pose(const std::filesystem::path& path);
/// The object of a code file for row `index` of the codes.
[[nodiscard]] JsonValue code_file_json(const Codes& codes, std::int64_t index, const Pose& pose,
                                       const std::string& model = {});
/// The text of a code file for row `index` of the codes.
[[nodiscard]] std::string code_file_text(const Codes& codes, std::int64_t index, const Pose& pose,
                                         const std::string& model = {});
/// Writes a code file for row `index` of the codes, completely or not at all.
void write_code_file(const std::filesystem::path& path, const Codes& codes, std::int64_t index,
                     const Pose& pose, const std::string& model = {});

}  // namespace stymo
