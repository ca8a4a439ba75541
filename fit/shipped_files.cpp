#include "fit/shipped_files.h"

#include <dlfcn.h>

#include <system_error>
#include <vector>

namespace stymo {

namespace {

using std::filesystem::path;

/// The shared library or the program that holds this function, and the program.
std::vector<path> binaries() {
    std::vector<path> result;
    std::error_code error;
    Dl_info found{};
    // The name of a program is what it was called by, which need not be a path.
    if (dladdr(reinterpret_cast<const void*>(&binaries), &found) != 0 &&
        path(found.dli_fname).has_parent_path())
        result.push_back(std::filesystem::canonical(found.dli_fname, error));
    result.push_back(std::filesystem::read_symlink("/proc/self/exe", error));
    return result;
}

}  // namespace

path shipped_file(const path& name, const path& folder) {
    std::vector<path> candidates;
    if (!folder.empty()) {
        candidates = {folder};
    } else {
        constexpr int levels = 4;
        for (path above : binaries())
            for (int level = 0; level < levels && above.has_relative_path(); ++level) {
                above = above.parent_path();
                candidates.push_back(above / "configs");
                candidates.push_back(above / "share/stymo/configs");
            }
        candidates.emplace_back(STYMO_INSTALLED_CONFIGS);
    }
    std::error_code error;
    for (const path& candidate : candidates)
        if (std::filesystem::exists(candidate / name, error)) return candidate / name;
    return {};
}

path shipped_model(const path& folder) {
    return shipped_file("models/faces-256/model.safetensors", folder);
}

path named_model(const path& model, const path& folder) {
    if (model.empty()) return shipped_model(folder);
    std::error_code error;
    if (model.has_parent_path() || std::filesystem::is_regular_file(model, error)) return model;
    const path shipped = shipped_file("models" / model / "model.safetensors", folder);
    return shipped.empty() ? model : shipped;
}

path shipped_landmark_network(const path& folder) {
    return shipped_file("models/landmarks/landmarks.safetensors", folder);
}

path shipped_mask_network(const path& folder) {
    return shipped_file("models/head-mask/network.safetensors", folder);
}

}  // namespace stymo
