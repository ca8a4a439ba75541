#pragma once

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>

namespace stymo {

/// A file or folder of the data that is not distributed with the project: below $STYMO_SHARED, or
/// ../shared beside the sources. Without it none, and one line says that the test is skipped.
[[nodiscard]] inline std::optional<std::filesystem::path> shared_data(
    const std::filesystem::path& name = {}) {
    const char* variable = std::getenv("STYMO_SHARED");
    const std::filesystem::path folder =
        variable != nullptr ? std::filesystem::path(variable)
                            : std::filesystem::path(STYMO_SOURCE_DIR) / "../shared";
    if (std::filesystem::exists(folder / name)) return folder / name;
    std::cout << "skipped: no shared data\n";
    return std::nullopt;
}

}  // namespace stymo
