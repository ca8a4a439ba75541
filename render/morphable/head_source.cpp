#include "render/morphable/head_source.h"

#include <sstream>

#include "core/error.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/scanned_head.h"

namespace stymo {

namespace {

/// The optional metadata "expr_names": one name for each expression, joined by commas.
[[nodiscard]] std::vector<std::string> names_of(const morphable::HeadTensors& file,
                                                std::int64_t count) {
    std::vector<std::string> names;
    if (!file.has_metadata("expr_names")) return names;
    std::istringstream list(file.metadata("expr_names"));
    for (std::string name; std::getline(list, name, ',');) names.push_back(name);
    if (std::ssize(names) != count)
        fail<FileError>(file.path(), ": \"basis.expr\" has ", count, " rows, the metadata ",
                        names.size(), " \"expr_names\"");
    return names;
}

}  // namespace

MorphableHead read_morphable_head(const std::filesystem::path& path) {
    const morphable::HeadTensors file(path, "a morphable head");
    const Tensor mean = file.take("mean", 2, {3}, "(V, 3)");
    const std::int64_t count = mean.shape(0);
    const Tensor identity = file.take("basis.id", {MorphableHead::identity_size, count, 3});
    const Tensor expression = file.take("basis.expr", 3, {count, 3}, "(1 to 79, V, 3)");
    if (expression.shape(0) > MorphableHead::expression_size)
        fail<FileError>(path.string(), ": \"basis.expr\" is ", expression.shape(),
                        ", expected (1 to 79, V, 3)");
    return morphable::head_from_scans({path.string(), mean, identity, expression,
                                       file.triangles("triangles", count), file.landmarks(count),
                                       names_of(file, expression.shape(0))});
}

MorphableHead morphable_head_from(const std::filesystem::path& path) {
    if (path.empty()) return builtin_head();
    if (std::filesystem::is_directory(path)) return read_obj_head(path);
    return read_morphable_head(path);
}

}  // namespace stymo
