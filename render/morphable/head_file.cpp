#include "render/morphable/head_file.h"

#include "core/error.h"
#include "core/io/tensor_file.h"
#include "render/morphable/scanned_head.h"

namespace stymo {

namespace {

[[nodiscard]] Tensor take(TensorFile& file, const std::string& name,
                          const std::filesystem::path& path) {
    const auto found = file.tensors.find(name);
    if (found == file.tensors.end())
        fail<FileError>(path.string(), ": holds no tensor \"", name, "\"; is it a morphable head?");
    if (!found->second.all_finite())
        fail<FileError>(path.string(), ": \"", name, "\" holds values that are not finite");
    return found->second.to(DType::float32);
}

void require_shape(const Tensor& tensor, const Shape& shape, const std::string& name,
                   const std::filesystem::path& path) {
    if (!(tensor.shape() == shape))
        fail<FileError>(path.string(), ": \"", name, "\" is ", tensor.shape(), ", expected ",
                        shape);
}

[[nodiscard]] std::int32_t vertex_index(float value, std::int64_t vertex_count,
                                        const std::string& name,
                                        const std::filesystem::path& path) {
    if (!(value >= 0.0F) || !(value < static_cast<float>(vertex_count))) {
        fail<FileError>(path.string(), ": \"", name, "\" names vertex ", value, " of ",
                        vertex_count);
    }
    return static_cast<std::int32_t>(value);
}

}  // namespace

MorphableHead read_morphable_head(const std::filesystem::path& path) {
    TensorFile file = read_tensor_file(path);
    const Tensor mean = take(file, "mean", path);
    if (mean.rank() != 2 || mean.shape(1) != 3 || mean.shape(0) < 1)
        fail<FileError>(path.string(), ": \"mean\" is ", mean.shape(), ", expected (V, 3)");
    const std::int64_t count = mean.shape(0);
    const Tensor identity = take(file, "basis.id", path);
    require_shape(identity, {MorphableHead::identity_size, count, 3}, "basis.id", path);
    const Tensor expression = take(file, "basis.expr", path);
    const std::int64_t shapes = expression.rank() == 3 ? expression.shape(0) : 0;
    if (shapes < 1 || shapes > MorphableHead::expression_size)
        fail<FileError>(path.string(), ": \"basis.expr\" is ", expression.shape(),
                        ", expected (1 to 79, V, 3)");
    require_shape(expression, {shapes, count, 3}, "basis.expr", path);
    const Tensor triangles = take(file, "triangles", path);
    require_shape(triangles, {triangles.size() / 3, 3}, "triangles", path);
    const Tensor landmarks = take(file, "landmarks68", path);
    require_shape(landmarks, {68}, "landmarks68", path);

    morphable::ScannedHead head{path.string(), mean, identity, expression, {}, {}};
    for (std::size_t k = 0; k < head.landmarks.size(); ++k)
        head.landmarks[k] = vertex_index(landmarks.values<float>()[k], count, "landmarks68", path);
    for (std::size_t i = 0; i < static_cast<std::size_t>(triangles.size()); i += 3) {
        std::array<std::int32_t, 3>& triangle = head.triangles.emplace_back();
        for (std::size_t k = 0; k < 3; ++k)
            triangle[k] = vertex_index(triangles.values<float>()[i + k], count, "triangles", path);
    }
    return morphable::head_from_scans(head);
}

}  // namespace stymo
