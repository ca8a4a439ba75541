#include "apps/common/result_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>
#include <utility>

#include "core/interrupt.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "core/parallel.h"
#include "train/data/folder_scan.h"

namespace stymo {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr const char* settings_file = "settings.json";

void require_same_settings(const fs::path& folder, const std::string& wanted) {
    std::string begun = read_file(folder / settings_file);
    if (begun.ends_with('\n')) begun.pop_back();
    if (begun == wanted) return;
    const Json before = json_fault(begun) ? Json() : Json::parse(begun, nullptr, false);
    const Json now = Json::parse(wanted);
    if (!before.is_object())
        fail<FileError>(folder.string(),
                        ": its settings are not JSON; remove the folder and start again");
    for (const auto& [key, value] : now.items())
        if (!before.contains(key) || before[key] != value)
            fail<FileError>(folder.string(), ": was begun with other settings (", key, " was ",
                            before.value(key, Json("unknown")).dump(), ", now ", value.dump(),
                            "); give the same ones or another --out");
    if (before.size() == now.size()) return;  // in another order
    fail<FileError>(folder.string(),
                    ": was begun by another version of the program; give another --out");
}

/// Calls `visit` with each complete line, its number (from 1) and its offset in bytes.
template <class Visit>
void visit_whole_lines(const fs::path& file, const Visit& visit) {
    std::istringstream stream(read_file(file));
    std::string line;
    std::streamoff whole = 0;
    // The last line is complete only if a line break ends it.
    for (int number = 1; std::getline(stream, line) && !stream.eof(); ++number) {
        visit(line, number, whole);
        whole = stream.tellg();
    }
}

/// Removes what follows the last complete line.
void cut_partial_line(const fs::path& file) {
    const std::size_t whole = read_file(file).rfind('\n') + 1;  // 0 without a line break
    std::error_code error;
    if (fs::file_size(file, error) != whole) fs::resize_file(file, whole, error);
    if (error) fail<FileError>(file.string(), ": cannot be written (", error.message(), ")");
}

/// What the member `key` names. Throws FileError.
std::string name_in(const std::string& line, const std::string& key) {
    require_sound_json(line);
    const Json value = Json::parse(line, nullptr, false);
    if (!value.is_object()) fail<FileError>("not JSON");
    if (!value.contains(key) || !value[key].is_string())
        fail<FileError>("has no text \"", key, "\"");
    return value[key].get<std::string>();
}

/// Whether there is nothing at `path`, or a folder with nothing but what a process leaves that dies
/// before its settings are written: the lock and their temporary file (write_whole).
bool is_unused(const fs::path& path) {
    if (!fs::exists(path)) return true;
    if (!fs::is_directory(path)) return false;
    return std::ranges::all_of(fs::directory_iterator(path), [](const auto& entry) {
        const std::string name = entry.path().filename().string();
        return name == ".lock" || (name.starts_with(".settings.") && name.ends_with(".part.json"));
    });
}

}  // namespace

JsonValue to_json(const Settings& settings) {
    JsonValue json = JsonValue::object();
    for (const auto& [option, value] : settings) json.add(option, value);
    return json;
}

CommonState common_state(const JsonValue& settings, std::span<const std::string> photos) {
    std::string names;
    for (const std::string& photo : photos) names += photo + '\n';
    return {{"settings", settings.text()}, {"a folder of photos", std::to_string(crc32c(names))}};
}

void ResultFolder::require_own(const fs::path& path) {
    if (!is_unused(path) && !fs::exists(path / settings_file))
        fail<FileError>(path.string(), ": exists already; choose another folder or remove it");
}

void ResultFolder::require_apart(const fs::path& path, const fs::path& photos) {
    const fs::path images = image_folder(photos), root = fs::weakly_canonical(images),
                   out = fs::weakly_canonical(path);
    if (std::ranges::mismatch(root, out).in1 == root.end())
        fail<FileError>(path.string(), ": lies in ", images.string(),
                        ", so its images would count as photos; choose a folder outside");
}

ResultFolder::ResultFolder(fs::path path, const Settings& settings, std::string name,
                           std::string key, Ranks& ranks)
    : path_(std::move(path)), name_(std::move(name)), key_(std::move(key)), ranks_(ranks) {
    settings_ = to_json(settings);
    const bool begun = fs::exists(path_ / settings_file);
    if (!begun && !parts().empty())
        fail<FileError>(path_.string(), ": holds ", name_,
                        ".jsonl but no settings.json; give another --out");
    read_lines();
    if (begun) require_same_settings(path_, settings_.text());
}

/// The files of all ranks, that of rank 0 first if it is there.
std::vector<fs::path> ResultFolder::parts() const {
    std::vector<fs::path> parts;
    if (!fs::is_directory(path_)) return parts;
    for (const auto& entry : fs::directory_iterator(path_)) {
        const std::string file = entry.path().filename();
        if (file.starts_with(name_ + ".") && file.ends_with(".jsonl"))
            parts.push_back(entry.path());
    }
    std::ranges::sort(parts, {}, [](const fs::path& part) {
        return std::pair(part.string().size(), part.string());
    });
    return parts;
}

void ResultFolder::read_lines() {
    lines_.clear();
    for (const fs::path& part : parts()) {
        visit_whole_lines(part, [&](const std::string& line, int number, std::int64_t offset) {
            try {
                lines_[name_in(line, key_)] = {part, offset};
            } catch (const Error& error) {
                fail<FileError>(part.string(), ", line ", number, ": ", error.what(), start_again);
            }
        });
    }
}

std::vector<std::string> ResultFolder::photos() const {
    std::vector<std::string> photos;
    for (const auto& [photo, line] : lines_) photos.push_back(photo);
    return photos;
}

std::string ResultFolder::line_of(const std::string& photo) const {
    std::ifstream stream(lines_.at(photo).file, std::ios::binary);
    stream.seekg(lines_.at(photo).offset);
    std::string line;
    if (!std::getline(stream, line)) fail<FileError>("cannot be read");
    return line;
}

CommonState ResultFolder::state(std::span<const std::string> photos) const {
    std::string finished;
    for (const auto& [photo, line] : lines_) finished += photo + '\n';
    CommonState state = common_state(settings_, photos);
    state.emplace_back("a list of finished photos", std::to_string(crc32c(finished)));
    return state;
}

void ResultFolder::begin() {
    if (ranks_.leads()) {
        require_writable_folder(path_);
        lock_.emplace(path_);
        for (const fs::path& part : parts()) cut_partial_line(part);
        if (!fs::exists(path_ / settings_file))
            write_file(path_ / settings_file, settings_.text() + "\n");
        remove_temporary_files(path_);
        for (const auto& entry : fs::recursive_directory_iterator(path_))
            if (entry.is_directory()) remove_temporary_files(entry.path());
    }
    static_cast<void>(any(ranks_, false));
}

void ResultFolder::append(const JsonValue& line) const {
    const std::string rank = ranks_.leads() ? "" : "." + std::to_string(ranks_.rank());
    append_line(path_ / (name_ + rank + ".jsonl"), line.text(), Durability::crash_safe);
}

void ResultFolder::join(std::span<const std::string> photos) {
    read_lines();
    const fs::path whole = path_ / (name_ + ".jsonl");
    write_whole(whole, [&](const fs::path& temporary) {
        std::ofstream stream(temporary, std::ios::binary);
        for (const std::string& photo : photos)
            if (contains(photo)) stream << line_of(photo) << '\n';
        stream.flush();
        if (!stream) fail<FileError>(whole.string(), ": cannot be written; is the disk full?");
    });
    for (const fs::path& part : parts())
        if (part != whole) fs::remove(part);
    read_lines();
}

void ResultFolder::remove() {
    fs::remove(path_ / settings_file);
    for (const fs::path& part : parts()) fs::remove(part);
    fs::remove(path_ / ".lock");
    if (fs::is_empty(path_)) fs::remove(path_);
}

void work_until_stopped(std::int64_t count, bool one_by_one,
                        const std::function<void(std::int64_t)>& work) {
    std::atomic<bool> failed = false;
    const auto guarded = [&](std::int64_t i) {
        if (failed.load() || interrupted()) return;
        try {
            work(i);
        } catch (...) {
            // Otherwise the other threads would go on as long as there is work.
            failed = true;
            throw;
        }
    };
    if (!one_by_one) return parallel_tasks(count, guarded);
    for (std::int64_t i = 0; i < count; ++i) guarded(i);
}

std::string with_checksum(const fs::path& file) {
    std::ostringstream text;
    text << fs::absolute(file).string() << ", CRC-32C " << std::hex << crc32c(read_file(file));
    return text.str();
}

FolderLock::FolderLock(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / ".lock";
    file_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file_ < 0)
        fail<FileError>(path.string(), ": cannot be written (", std::strerror(errno), ")");
    if (::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    ::close(file_);
    fail<FileError>(folder.string(),
                    ": another process is working in this folder; wait for it to end or choose "
                    "another one");
}

FolderLock::~FolderLock() {
    ::close(file_);
}

}  // namespace stymo
