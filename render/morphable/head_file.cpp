#include "render/morphable/head_file.h"

#include "core/error.h"
#include "render/morphable/head_tensors.h"
#include "render/morphable/scanned_head.h"

namespace stymo {

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
                                       file.triangles("triangles", count), file.landmarks(count)});
}

}  // namespace stymo
