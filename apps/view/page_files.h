#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace stymo::view {

/// A file of the page, which is embedded in the program.
struct PageFile {
    std::string_view name;  ///< "index.html"
    std::string_view text;
};

/// The file of the folder apps/view/page with this name; nothing if there is none.
[[nodiscard]] std::optional<PageFile> page_file(const std::string& name);

}  // namespace stymo::view
