#include "train/run_folder.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <ctime>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/exact_text.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "train/checkpoint.h"

namespace stymo {

namespace {

std::string numbered(std::int64_t step) {
    constexpr std::size_t least_digits = 6;
    const std::string digits = exact_text(step);
    return std::string(least_digits - std::min(least_digits, digits.size()), '0') + digits;
}

std::string time_text() {
    const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    std::tm parts{};
    localtime_r(&now, &parts);
    std::ostringstream text;
    text << std::put_time(&parts, "%F %T");
    return text.str();
}

/// The number behind "step": at the start of a line of stats.jsonl, or -1.
std::int64_t step_of(std::string_view line) {
    constexpr std::string_view start = "{\"step\":";
    std::int64_t step = -1;
    if (line.starts_with(start))
        std::from_chars(line.data() + start.size(), line.data() + line.size(), step);
    return step;
}

/// Writes the numbers of a JSON object as scalars; null stands for a number that is not finite.
void write_scalars(EventFile& events, std::int64_t step, const std::string& prefix,
                   const nlohmann::ordered_json& object) {
    for (const auto& [key, value] : object.items()) {
        if (value.is_object()) write_scalars(events, step, prefix + key + "/", value);
        if (value.is_number()) events.scalar(step, prefix + key, value.get<double>());
    }
}

}  // namespace

std::filesystem::path latest_checkpoint(const std::filesystem::path& run) {
    const std::filesystem::path pointer = run / "latest";
    if (!std::filesystem::exists(pointer))
        fail<FileError>(run.string(), ": no checkpoint to resume from; start without --resume");
    std::string name = read_file(pointer);
    while (!name.empty() && (name.back() == '\n' || name.back() == '\r' || name.back() == ' '))
        name.pop_back();
    if (name.empty() || name.find_first_not_of("0123456789") != std::string::npos)
        fail<FileError>(pointer.string(), ": names no checkpoint; give --resume one of ",
                        (run / "checkpoints").string());
    return run / "checkpoints" / name;
}

RunFolder::RunFolder(std::filesystem::path path, bool resume) : path_(std::move(path)) {
    if (!resume && std::filesystem::exists(path_ / "latest")) {
        fail<FileError>(path_.string(),
                        ": holds a training run already; continue it with --resume latest or "
                        "choose another --out");
    }
    require_writable_folder(path_);
    require_writable_folder(path_ / "samples");
    require_writable_folder(path_ / "checkpoints");
    repair_checkpoint_folders(path_ / "checkpoints");
    remove_temporary_files(path_);
    remove_temporary_files(path_ / "samples");
}

EventFile& RunFolder::events() const {
    if (!events_) events_.emplace(path_);
    return *events_;
}

std::filesystem::path RunFolder::checkpoint(std::int64_t step) const {
    return path_ / "checkpoints" / numbered(step);
}

bool RunFolder::replace_config(std::string_view json) const {
    const std::filesystem::path file = path_ / "config.json";
    const bool changed = std::filesystem::exists(file) && read_file(file) != json;
    if (changed) log("the configuration has changed");
    write_file(file, json);
    return changed;
}

void RunFolder::log(std::string_view line) const {
    append_line(path_ / "log.txt", time_text() + " " + std::string(line), Durability::none);
}

void RunFolder::statistics(const JsonValue& object) const {
    append_line(path_ / "stats.jsonl", object.text(), Durability::none);
    nlohmann::ordered_json numbers = nlohmann::ordered_json::parse(object.text());
    const std::int64_t step = numbers.value("step", std::int64_t{0});
    numbers.erase("step");
    write_scalars(events(), step, "", numbers);
}

void RunFolder::forget_statistics_after(std::int64_t step) const {
    events().restart(step + 1);
    const std::filesystem::path file = path_ / "stats.jsonl";
    if (!std::filesystem::exists(file)) return;
    std::istringstream lines(read_file(file));
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
        // A crash may have cut off or emptied the last lines.
        const std::int64_t number = step_of(line);
        if (line.ends_with('}') && number >= 0 && number <= step) kept += line + '\n';
    }
    write_file(file, kept);
}

void RunFolder::sample(std::int64_t step, const Tensor& image) const {
    write_image(path_ / "samples" / (numbered(step) + ".png"), image);
    events().image(step, "samples", image);
}

void RunFolder::finish_checkpoint(std::int64_t step, std::int64_t keep) const {
    // A run that is resumed from this checkpoint does not write the earlier statistics again.
    const std::filesystem::path statistics = path_ / "stats.jsonl";
    if (std::filesystem::exists(statistics)) flush_to_disk(statistics);
    flush_names(path_);
    write_file(path_ / "latest", numbered(step) + "\n");
    repair_checkpoint_folders(path_ / "checkpoints");
    std::vector<std::pair<std::int64_t, std::filesystem::path>> older;
    for (const auto& entry : std::filesystem::directory_iterator(path_ / "checkpoints")) {
        const std::optional<std::int64_t> number = checkpoint_step(entry.path());
        if (number && *number < step) older.emplace_back(*number, entry.path());
    }
    std::ranges::sort(older);
    const auto surplus = static_cast<std::int64_t>(older.size()) + 1 - keep;
    for (std::int64_t i = 0; i < surplus; ++i)
        remove_checkpoint_folder(older[static_cast<std::size_t>(i)].second);
}

}  // namespace stymo
