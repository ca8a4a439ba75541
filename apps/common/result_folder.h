#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/common/ranked_run.h"
#include "core/error.h"
#include "core/io/json_writer.h"

namespace stymo {

/// Reserves a folder for this process. The lock ends with the process, however that ends.
class FolderLock {
public:
    /// Locks the file `folder`/.lock, which stays when the lock ends. Throws FileError if another
    /// process has locked the folder or the file cannot be made. Does nothing on a file system
    /// without locks.
    explicit FolderLock(const std::filesystem::path& folder);
    ~FolderLock();
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;

private:
    int file_;
};

[[nodiscard]] JsonValue to_json(const Settings& settings);

/// What must be the same on all ranks of a run over photos without a ResultFolder.
[[nodiscard]] CommonState common_state(const JsonValue& settings,
                                       std::span<const std::string> photos);

/// The output folder of a run over many photos, which can be interrupted and divided among ranks:
/// settings.json, and the results in NAME.jsonl, one JSON object a line whose member KEY names the
/// photo. Rank 0 appends to NAME.jsonl, rank R to NAME.R.jsonl, so that no two ranks write to one
/// file and one that dies loses no result.
class ResultFolder {
public:
    /// Throws FileError if there is something at `path`, unless it is such a folder or is empty. A
    /// lock and a part of settings.json, which a process leaves that dies at the begin, do not
    /// count.
    static void require_own(const std::filesystem::path& path);
    /// Throws FileError if `path` is in the folder of photos, which is searched as a whole: what
    /// is written there would be photos of the next run.
    static void require_apart(const std::filesystem::path& path,
                              const std::filesystem::path& photos);

    /// Reads what earlier runs have left, but for a partial last line, which a crash leaves. Writes
    /// nothing: another process may work there. The values of `settings` are strings, numbers and
    /// booleans. Throws FileError if the folder was begun with other settings, naming the first
    /// difference, if it has results but no settings, and for a line without KEY.
    ResultFolder(std::filesystem::path path, const Settings& settings, std::string name,
                 std::string key, Ranks& ranks);

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    [[nodiscard]] const JsonValue& settings() const { return settings_; }
    /// Whether the photo had a result at construction, or when the results were joined.
    [[nodiscard]] bool contains(const std::string& photo) const { return lines_.contains(photo); }
    /// All such photos, also those that are no longer there.
    [[nodiscard]] std::vector<std::string> photos() const;
    /// `parse(line)` of such a photo. Errors become a FileError that names the file.
    template <class Parse>
    [[nodiscard]] auto read(const std::string& photo, const Parse& parse) const {
        try {
            return parse(line_of(photo));
        } catch (const Error& error) {
            fail<FileError>(lines_.at(photo).file.string(), ": ", error.what(), start_again);
        }
    }
    /// What must be the same on all ranks, of which each knows `photos`.
    [[nodiscard]] CommonState state(std::span<const std::string> photos) const;

    /// Makes and locks the folder, on rank 0, while the others wait, and removes partial lines.
    /// Throws FileError if another process is working in it or it cannot be written.
    void begin();
    /// Adds a line, which is on the disk when this function returns.
    void append(const JsonValue& line) const;
    /// Joins the lines of all ranks, which must have ended, in NAME.jsonl in the order of `photos`.
    void join(std::span<const std::string> photos);
    /// Removes settings, results and lock; and the folder, if it is then empty.
    void remove();

private:
    struct Line {
        std::filesystem::path file;
        std::int64_t offset;
    };
    static constexpr const char* start_again = "; remove the folder and start again";

    [[nodiscard]] std::vector<std::filesystem::path> parts() const;
    [[nodiscard]] std::string line_of(const std::string& photo) const;
    void read_lines();

    std::filesystem::path path_;
    std::string name_;
    std::string key_;
    JsonValue settings_ = JsonValue::object();
    Ranks& ranks_;
    std::map<std::string, Line> lines_;
    std::optional<FolderLock> lock_;
};

/// The items that fall to this rank, if the ranks take them in turn.
template <class Item>
[[nodiscard]] std::vector<Item> share_of(const Ranks& ranks, const std::vector<Item>& items) {
    std::vector<Item> share;
    for (auto i = static_cast<std::size_t>(ranks.rank()); i < items.size();
         i += static_cast<std::size_t>(ranks.size()))
        share.push_back(items[i]);
    return share;
}

/// Calls work(i) for each i of [0, count), on a thread each or `one_by_one`. An interruption or an
/// exception, which is rethrown, leaves out the calls that have not begun.
void work_until_stopped(std::int64_t count, bool one_by_one,
                        const std::function<void(std::int64_t)>& work);

/// A file's absolute name and checksum, for the settings of a run that reads it.
[[nodiscard]] std::string with_checksum(const std::filesystem::path& file);

}  // namespace stymo
