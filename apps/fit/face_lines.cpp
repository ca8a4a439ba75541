#include "apps/fit/face_lines.h"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "apps/common/begun_settings.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {

namespace {

namespace fs = std::filesystem;

/// The files of all ranks in a folder, that of rank 0 first if it is there.
std::vector<fs::path> parts_in(const fs::path& folder) {
    std::vector<fs::path> parts;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename();
        if (name.starts_with("faces.") && name.ends_with(".jsonl")) parts.push_back(entry.path());
    }
    std::ranges::sort(parts, [](const fs::path& a, const fs::path& b) {
        return std::pair(a.string().size(), a) < std::pair(b.string().size(), b);
    });
    return parts;
}

}  // namespace

FaceLines::FaceLines(fs::path folder, int rank)
    : folder_(std::move(folder)),
      own_(folder_ / (rank == 0 ? "faces.jsonl" : "faces." + std::to_string(rank) + ".jsonl")) {
    read();
}

void FaceLines::read() {
    lines_.clear();
    for (const fs::path& part : parts_in(folder_)) {
        visit_whole_lines(part, [&](const std::string& line, int, std::int64_t offset) {
            require_sound_json(line);
            const auto value = nlohmann::json::parse(line, nullptr, false);
            if (!value.is_object() || !value.contains("file") || !value["file"].is_string())
                fail<FileError>("not what became of a photo");
            const auto failure = value.find("failure");
            const bool failed = failure != value.end() && failure->is_string();
            lines_[value["file"].get<std::string>()] = {part, offset,
                                                        failed ? failure->get<std::string>() : ""};
        });
    }
}

void FaceLines::append(const JsonValue& line) const {
    append_line(own_, line.text(), Durability::crash_safe);
}

void FaceLines::join(std::span<const std::string> files) {
    read();
    const fs::path whole = folder_ / "faces.jsonl";
    write_whole(whole, [&](const fs::path& temporary) {
        std::ofstream stream(temporary, std::ios::binary);
        for (const std::string& file : files) {
            const auto found = lines_.find(file);
            if (found == lines_.end()) continue;
            std::ifstream part(found->second.path, std::ios::binary);
            part.seekg(found->second.offset);
            std::string line;
            std::getline(part, line);
            stream << line << '\n';
        }
        stream.flush();
        if (!stream) fail<FileError>(whole.string(), ": cannot be written; is the disk full?");
    });
    for (const fs::path& part : parts_in(folder_))
        if (part != whole) fs::remove(part);
}

}  // namespace stymo
