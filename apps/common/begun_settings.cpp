#include "apps/common/begun_settings.h"

#include <nlohmann/json.hpp>

#include "core/error.h"

namespace stymo {

void require_same_settings(const std::filesystem::path& folder, const std::string& begun, const std::string& wanted) {
    if (begun == wanted) return;
    using Json = nlohmann::json;
    const Json before = Json::parse(begun, nullptr, false);
    const Json now = Json::parse(wanted);
    if (!before.is_object()) fail<FileError>(folder.string(), ": its settings are not JSON; remove the folder and begin anew");
    for (const auto& [key, value] : now.items())
        if (!before.contains(key) || before[key] != value)
            fail<FileError>(folder.string(), ": was begun with other settings (", key, " was ",
                            before.value(key, Json("unknown")).dump(), ", now ", value.dump(),
                            "); give the same ones or another --out");
    fail<FileError>(folder.string(), ": was begun by another version of the program; give another --out");
}

}  // namespace stymo
