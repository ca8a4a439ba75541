#include "train/checkpoint_checksums.h"

#include <cstdint>
#include <iomanip>
#include <map>
#include <sstream>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/file.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

constexpr const char* list_name = "checksums.txt";

/// Checksum and size of a file in the format of checksums.txt.
std::string seal_of(const fs::path& file) {
    std::uint32_t checksum = 0;
    std::uint64_t size = 0;
    read_parts(file, [&](std::string_view part) {
        checksum = crc32c(part, checksum);
        size += part.size();
    });
    std::ostringstream text;
    text << std::hex << std::setw(8) << std::setfill('0') << checksum << ' ' << std::dec << size;
    return text.str();
}

/// Checksums and sizes of the files, by name.
std::map<std::string, std::string> seals_of(const fs::path& folder) {
    std::map<std::string, std::string> seals;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        if (entry.is_regular_file() && name != list_name) seals[name] = seal_of(entry.path());
    }
    return seals;
}

std::map<std::string, std::string> read_list(const fs::path& list) {
    std::map<std::string, std::string> seals;
    const std::string text = read_file(list);
    if (!text.ends_with('\n')) fail<FileError>(list.string(), ": is damaged");
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        const std::size_t space = line.rfind(' ');
        if (space == std::string::npos) fail<FileError>(list.string(), ": is damaged");
        seals[line.substr(space + 1)] = line.substr(0, space);
    }
    return seals;
}

}  // namespace

void write_checksums(const fs::path& folder) {
    std::string lines;
    for (const auto& [name, seal] : seals_of(folder)) lines += seal + ' ' + name + '\n';
    write_file(folder / list_name, lines);
}

void verify_checksums(const fs::path& folder) {
    const fs::path list = folder / list_name;
    if (!fs::exists(list)) return;
    const std::map<std::string, std::string> expected = read_list(list);
    const std::map<std::string, std::string> found = seals_of(folder);
    for (const auto& [name, seal] : expected) {
        const auto file = found.find(name);
        if (file == found.end()) fail<FileError>((folder / name).string(), ": is missing");
        if (file->second != seal)
            fail<FileError>((folder / name).string(), ": is damaged (checksum and size are ",
                            file->second, ", ", list_name, " says ", seal, ")");
    }
    for (const auto& [name, seal] : found)
        if (!expected.contains(name))
            fail<FileError>(list.string(), ": is damaged (", name, " is missing in it)");
}

}  // namespace stymo
