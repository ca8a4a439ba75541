#include "apps/prep/progress_file.h"

#include <nlohmann/json.hpp>

#include "apps/common/begun_settings.h"
#include "core/error.h"

namespace stymo {

std::filesystem::path ProgressFile::path_in(const std::filesystem::path& folder) {
    return folder / "progress.jsonl";
}

ProgressFile::ProgressFile(const std::filesystem::path& folder, const JsonValue& settings)
    : path_(path_in(folder)) {
    std::string begun;
    visit_whole_lines(path_, [&](const std::string& line, int number, std::int64_t offset) {
        const nlohmann::json value = nlohmann::json::parse(line, nullptr, false);
        if (!value.is_object()) fail<FileError>("not JSON");
        if (number == 1) begun = line;
        if (number > 1) lines_[value.value("file", "")] = offset;
    });
    if (!begun.empty()) require_same_settings(folder, begun, settings.text());
    stream_.open(path_, std::ios::app | std::ios::binary);
    stream_.seekp(0, std::ios::end);
    if (begun.empty()) stream_ << settings.text() << '\n' << std::flush;
    if (!stream_) fail<FileError>(path_.string(), ": cannot be written");
}

PhotoOutcome ProgressFile::read(const std::string& file) const {
    std::ifstream stream(path_, std::ios::binary);
    stream.seekg(lines_.at(file));
    std::string line;
    std::getline(stream, line);
    try {
        return parse_photo_outcome(line);
    } catch (const Error& error) {
        fail<FileError>(path_.string(), ": ", error.what(), "; remove the folder and start again");
    }
}

void ProgressFile::append(const PhotoOutcome& outcome) {
    const std::streamoff place = stream_.tellp();
    stream_ << to_json(outcome).text() << '\n' << std::flush;
    if (!stream_) fail<FileError>(path_.string(), ": cannot be written; is the disk full?");
    lines_[outcome.file] = place;
}

}  // namespace stymo
