#include "apps/prep/progress_file.h"

#include <nlohmann/json.hpp>

#include "apps/common/begun_settings.h"
#include "core/error.h"

namespace stymo {

std::filesystem::path ProgressFile::path_in(const std::filesystem::path& folder) {
    return folder / "progress.jsonl";
}

ProgressFile::ProgressFile(const std::filesystem::path& folder, const JsonValue& settings) : path_(path_in(folder)) {
    if (std::filesystem::exists(path_)) go_on(settings.text());
    stream_.open(path_, std::ios::app | std::ios::binary);
    stream_.seekp(0, std::ios::end);
    if (!stream_) fail<FileError>(path_.string(), ": cannot be written");
    if (stream_.tellp() == 0) begin(settings);
}

void ProgressFile::begin(const JsonValue& settings) {
    stream_ << settings.text() << '\n' << std::flush;
    if (!stream_) fail<FileError>(path_.string(), ": cannot be written");
}

void ProgressFile::go_on(const std::string& settings) {
    std::ifstream stream(path_, std::ios::binary);
    std::string line;
    std::streamoff whole = 0;
    // The last line is whole only if a line break ends it.
    for (int number = 1; std::getline(stream, line) && !stream.eof(); ++number) {
        const nlohmann::json value = nlohmann::json::parse(line, nullptr, false);
        if (!value.is_object())
            fail<FileError>(path_.string(), ", line ", number, ": not JSON; remove the folder and begin anew");
        if (number == 1) require_same_settings(path_.parent_path(), line, settings);
        if (number > 1) lines_[value.value("file", "")] = whole;
        whole = stream.tellg();
    }
    stream.close();
    std::filesystem::resize_file(path_, static_cast<std::uintmax_t>(whole));
}

PhotoOutcome ProgressFile::read(const std::string& file) const {
    std::ifstream stream(path_, std::ios::binary);
    stream.seekg(lines_.at(file));
    std::string line;
    std::getline(stream, line);
    try {
        return parse_photo_outcome(line);
    } catch (const Error& error) {
        fail<FileError>(path_.string(), ": ", error.what(), "; remove the folder and begin anew");
    }
}

void ProgressFile::append(const PhotoOutcome& outcome) {
    const std::streamoff place = stream_.tellp();
    stream_ << to_json(outcome).text() << '\n' << std::flush;
    if (!stream_) fail<FileError>(path_.string(), ": cannot be written; is the disk full?");
    lines_[outcome.file] = place;
}

}  // namespace stymo
