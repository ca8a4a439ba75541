#include "apps/common/begun_settings.h"

#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>

#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {

void require_same_settings(const std::filesystem::path& folder, const std::string& begun,
                           const std::string& wanted) {
    if (begun == wanted) return;
    using Json = nlohmann::json;
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

void begin_or_continue(const std::filesystem::path& folder, const JsonValue& settings,
                       const std::string& results) {
    const std::filesystem::path file = folder / "settings.json";
    if (std::filesystem::exists(file)) {
        std::string begun = read_file(file);
        if (begun.ends_with('\n')) begun.pop_back();
        return require_same_settings(folder, begun, settings.text());
    }
    if (std::filesystem::exists(folder / results))
        fail<FileError>(folder.string(), ": holds ", results,
                        " but no settings.json; give another --out");
    require_writable_folder(folder);
    write_file(file, settings.text() + "\n");
}

std::string with_checksum(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::filesystem::absolute(file).string() << ", CRC-32C " << std::hex
         << crc32c(read_file(file));
    return text.str();
}

void visit_whole_lines(
    const std::filesystem::path& file,
    const std::function<void(const std::string& line, int number, std::int64_t offset)>& visit) {
    if (!std::filesystem::exists(file)) return;
    std::istringstream stream(read_file(file));
    std::string line;
    std::streamoff whole = 0;
    // The last line is complete only if a line break ends it.
    for (int number = 1; std::getline(stream, line) && !stream.eof(); ++number) {
        try {
            visit(line, number, whole);
        } catch (const Error& error) {
            fail<FileError>(file.string(), ", line ", number, ": ", error.what(),
                            "; remove the folder and start again");
        }
        whole = stream.tellg();
    }
    std::error_code error;
    std::filesystem::resize_file(file, static_cast<std::uintmax_t>(whole), error);
    if (error) fail<FileError>(file.string(), ": cannot be written (", error.message(), ")");
}

}  // namespace stymo
