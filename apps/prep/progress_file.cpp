#include "apps/prep/progress_file.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/common/begun_settings.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {

std::filesystem::path ProgressFile::path_in(const std::filesystem::path& folder) {
    return folder / "progress.jsonl";
}

ProgressFile::ProgressFile(const std::filesystem::path& folder, const JsonValue& settings)
    : path_(path_in(folder)) {
    std::string begun;
    visit_whole_lines(path_, [&](const std::string& line, int number, std::int64_t offset) {
        require_sound_json(line);
        const nlohmann::json value = nlohmann::json::parse(line, nullptr, false);
        if (!value.is_object()) fail<FileError>("not JSON");
        if (number == 1) {
            begun = line;
        } else {
            if (!value.contains("file") || !value["file"].is_string())
                fail<FileError>("not what became of a photo");
            lines_[value["file"].get<std::string>()] = offset;
        }
    });
    if (!begun.empty()) require_same_settings(folder, begun, settings.text());
    if (begun.empty()) append_line(path_, settings.text(), Durability::crash_safe);
}

PhotoOutcome ProgressFile::read(const std::string& file) const {
    std::ifstream stream(path_, std::ios::binary);
    stream.seekg(lines_.at(file));
    std::string line;
    if (!std::getline(stream, line)) fail<FileError>(path_.string(), ": cannot be read");
    try {
        return parse_photo_outcome(line);
    } catch (const Error& error) {
        fail<FileError>(path_.string(), ": ", error.what(), "; remove the folder and start again");
    }
}

void ProgressFile::append(const PhotoOutcome& outcome) {
    const auto offset = static_cast<std::streamoff>(std::filesystem::file_size(path_));
    append_line(path_, to_json(outcome).text(), Durability::crash_safe);
    lines_[outcome.file] = offset;
}

}  // namespace stymo
