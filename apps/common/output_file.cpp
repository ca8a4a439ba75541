#include "apps/common/output_file.h"

#include <algorithm>
#include <string>
#include <system_error>

#include "apps/common/command_line.h"
#include "core/error.h"
#include "core/io/file.h"

namespace stymo {

void require_extension(const std::filesystem::path& path,
                       std::initializer_list<const char*> extensions) {
    if (std::ranges::find(extensions, path.extension().string()) != extensions.end()) return;
    std::string list;
    for (const char* extension : extensions)
        list += (list.empty() ? "" : " or ") + std::string(extension);
    fail<UsageError>(path.string(), ": the name must end in ", list);
}

void require_folder_of(const std::filesystem::path& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        fail<FileError>(path.string(), ": is a folder; give the name of a file");
    require_writable_folder(path.parent_path().empty() ? std::filesystem::path(".")
                                                       : path.parent_path());
}

}  // namespace stymo
