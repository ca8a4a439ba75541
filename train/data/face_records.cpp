#include "train/data/face_records.h"

#include <array>
#include <charconv>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/io/checksum.h"

namespace stymo {

namespace {

bool is_blank(std::string_view line) {
    return line.find_first_not_of(" \t\r") == std::string_view::npos;
}

/// Lists the lines of a file one by one.
class Listing {
public:
    explicit Listing(const std::filesystem::path& path) : path_(path) {}

    void add(std::string_view part) {
        for (std::size_t end = part.find('\n'); end != std::string_view::npos;
             end = part.find('\n')) {
            line_ += part.substr(0, end);
            finish_line();
            ++offset_;
            part.remove_prefix(end + 1);
        }
        line_ += part;
    }
    [[nodiscard]] FaceEntries entries() && {
        finish_line();
        return std::move(entries_);
    }

private:
    void finish_line() {
        const auto size = std::ssize(line_);
        ++number_;
        if (!is_blank(line_)) {
            try {
                auto [id, record] = parse_face_record(line_);
                FaceEntry entry{offset_,
                                size,
                                !record.code.empty(),
                                !record.landmarks.empty(),
                                record.pose,
                                std::move(record.origin)};
                if (!entries_.emplace(id, std::move(entry)).second)
                    fail<FileError>("the id \"", id, "\" comes twice");
            } catch (const FileError& error) {
                fail<FileError>(path_.string(), ", line ", number_, ": ", error.what());
            }
        }
        offset_ += size;
        line_.clear();
    }

    const std::filesystem::path& path_;
    std::string line_;
    std::int64_t offset_ = 0;  ///< of the line
    std::int64_t number_ = 0;
    FaceEntries entries_;
};

}  // namespace

FaceRecords::FaceRecords(const std::filesystem::path& file, std::int64_t index_from)
    : path_(file), file_(file) {
    const FileVersion version = version_of(file);
    const bool indexed = version.size >= index_from;
    if (indexed) {
        if (std::optional<FaceEntries> entries = read_face_index(file, version)) {
            entries_ = std::move(*entries);
            return;
        }
    }
    Listing listing(file);
    read_parts(file, [&](std::string_view part) { listing.add(part); });
    entries_ = std::move(listing).entries();
    if (indexed && version_of(file) == version) write_face_index(file, version, entries_);
}

void FaceRecords::add_pose(const std::string& id, const Pose& pose) {
    FaceEntry& entry = entries_[id];
    if (!entry.pose) entry.pose = pose;
}

const FaceEntry* FaceRecords::find(const std::string& id) const {
    const auto found = entries_.find(id);
    return found == entries_.end() ? nullptr : &found->second;
}

FaceRecord FaceRecords::read(const std::string& id) const {
    const FaceEntry* entry = find(id);
    if (entry == nullptr || entry->size == 0) return {};
    try {
        auto [found, record] = parse_face_record(file_->read(entry->offset, entry->size));
        if (found == id) return std::move(record);
    } catch (const FileError&) {
    }
    fail<FileError>(path_.string(), ": has changed since it was listed, the face \"", id,
                    "\" is not where it was; start again");
}

namespace {

namespace fs = std::filesystem;

constexpr std::string_view title = "stymo-face-index-3";
constexpr std::string_view code_mark = "c", landmarks_mark = "l", both_mark = "cl", no_mark = "-";

/// Words of a line between single blanks; the last one, the id, is the rest of it.
class Words {
public:
    explicit Words(std::string_view line) : rest_(line) {}

    [[nodiscard]] std::string_view next() {
        const std::size_t end = rest_.find(' ');
        const std::string_view word = rest_.substr(0, end);
        rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
        return word;
    }
    [[nodiscard]] std::string_view rest() const { return rest_; }
    /// Throws FileError for anything but a number.
    template <class T>
    void read(T& value) {
        const std::string_view word = next();
        const auto end = std::from_chars(word.data(), word.data() + word.size(), value);
        if (end.ec != std::errc{} || end.ptr != word.data() + word.size())
            fail<FileError>("not a number");
    }

private:
    std::string_view rest_;
};

std::string_view next_line(std::string_view& text) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    return line;
}

template <class T>
void append(std::string& text, T value) {
    std::array<char, 32> room{};
    const auto end = std::to_chars(room.data(), room.data() + room.size(), value);
    text.append(room.data(), end.ptr);
    text += ' ';
}

std::array<double, 6> numbers_of(const Pose& pose) {
    return {pose.yaw,           pose.pitch, pose.roll, pose.translation[0], pose.translation[1],
            pose.translation[2]};
}

void append_entry(std::string& text, const std::string& id, const FaceEntry& entry) {
    append(text, entry.offset);
    append(text, entry.size);
    text += entry.has_code ? (entry.has_landmarks ? both_mark : code_mark)
                           : (entry.has_landmarks ? landmarks_mark : no_mark);
    text += entry.pose ? " p " : " - ";
    if (entry.pose)
        for (const double number : numbers_of(*entry.pose)) append(text, number);
    text += id;
    for (const std::string* name :
         {&entry.origin.person, &entry.origin.series, &entry.origin.source, &entry.origin.take}) {
        text += '\t';
        text += *name;
    }
    text += '\n';
}

std::pair<std::string, FaceEntry> entry_of(std::string_view line) {
    Words words(line);
    FaceEntry entry;
    words.read(entry.offset);
    words.read(entry.size);
    const std::string_view marks = words.next();
    entry.has_code = marks == code_mark || marks == both_mark;
    entry.has_landmarks = marks == landmarks_mark || marks == both_mark;
    if (words.next() == "p") {
        Pose& pose = entry.pose.emplace();
        for (double* angle : {&pose.yaw, &pose.pitch, &pose.roll}) words.read(*angle);
        for (int axis = 0; axis < 3; ++axis) words.read(pose.translation[axis]);
    }
    std::string_view names = words.rest();
    const auto next_name = [&] {
        const std::size_t end = names.find('\t');
        const std::string name(names.substr(0, end));
        names.remove_prefix(end == std::string_view::npos ? names.size() : end + 1);
        return name;
    };
    std::string id = next_name();
    entry.origin.person = next_name();
    entry.origin.series = next_name();
    entry.origin.source = next_name();
    entry.origin.take = next_name();
    return {std::move(id), std::move(entry)};
}

}  // namespace

FileVersion version_of(const fs::path& file) {
    return {static_cast<std::int64_t>(fs::file_size(file)),
            fs::last_write_time(file).time_since_epoch().count()};
}

fs::path index_path(const fs::path& file) {
    return file.string() + ".index";
}

std::optional<FaceEntries> read_face_index(const fs::path& file, const FileVersion& version) {
    std::error_code ignored;
    if (!fs::exists(index_path(file), ignored)) return std::nullopt;
    try {
        const std::string text = read_file(index_path(file));
        std::string_view rest = text;
        Words first(next_line(rest));
        FileVersion indexed;
        std::uint32_t checksum = 0;
        if (first.next() != title) return std::nullopt;
        first.read(indexed.size);
        first.read(indexed.time);
        first.read(checksum);
        if (indexed != version || crc32c(rest) != checksum) return std::nullopt;
        FaceEntries entries;
        while (!rest.empty()) {
            const auto& [id, entry] = *entries.insert(entries.end(), entry_of(next_line(rest)));
            if (entry.offset < 0 || entry.size < 0 || entry.size > version.size ||
                entry.offset > version.size - entry.size)
                return std::nullopt;
        }
        return entries;
    } catch (const FileError&) {
        return std::nullopt;
    }
}

void write_face_index(const fs::path& file, const FileVersion& version,
                      const FaceEntries& entries) {
    std::string lines;
    for (const auto& [id, entry] : entries) {
        if (id.find_first_of("\t\n") != std::string::npos) return;
        append_entry(lines, id, entry);
    }
    std::string text(title);
    text += ' ';
    append(text, version.size);
    append(text, version.time);
    append(text, crc32c(lines));
    text += '\n';
    try {
        write_file(index_path(file), text + lines, Durability::none);
    } catch (const FileError&) {
        // Ignored: without an index only the next start is slower.
    }
}

}  // namespace stymo
