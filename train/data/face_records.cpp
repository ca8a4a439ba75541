#include "train/data/face_records.h"

#include <utility>

#include "core/error.h"
#include "train/data/face_index.h"

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

}  // namespace stymo
