#include "render/morphable/head_source.h"

#include "render/morphable/builtin_head.h"
#include "render/morphable/head_file.h"
#include "render/morphable/obj_head.h"

namespace stymo {

MorphableHead morphable_head_from(const std::filesystem::path& path) {
    if (path.empty()) return builtin_head();
    if (std::filesystem::is_directory(path)) return read_obj_head(path);
    return read_morphable_head(path);
}

}  // namespace stymo
