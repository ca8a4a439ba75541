#include "render/morphable/head_tensors.h"

#include <algorithm>

#include "core/error.h"

namespace stymo::morphable {

HeadTensors::HeadTensors(const std::filesystem::path& path, std::string kind)
    : path_(path), kind_(std::move(kind)), file_(read_tensor_file(path)) {}

std::string HeadTensors::metadata(const std::string& key) const {
    const auto found = file_.metadata.find(key);
    if (found == file_.metadata.end())
        fail<FileError>(path(), ": its metadata have no \"", key, "\"; is it ", kind_, "?");
    return found->second;
}

Tensor HeadTensors::take(const std::string& name) const {
    const auto found = file_.tensors.find(name);
    if (found == file_.tensors.end())
        fail<FileError>(path(), ": holds no tensor \"", name, "\"; is it ", kind_, "?");
    if (!found->second.all_finite())
        fail<FileError>(path(), ": \"", name, "\" holds values that are not finite");
    return found->second.to(DType::float32);
}

Tensor HeadTensors::take(const std::string& name, const Shape& shape) const {
    Tensor tensor = take(name);
    if (!(tensor.shape() == shape))
        fail<FileError>(path(), ": \"", name, "\" is ", tensor.shape(), ", expected ", shape);
    return tensor;
}

Tensor HeadTensors::take(const std::string& name, int rank,
                         std::initializer_list<std::int64_t> last, const char* form) const {
    Tensor tensor = take(name);
    const auto extents = tensor.shape().extents();
    if (tensor.rank() != rank || tensor.size() == 0 ||
        !std::equal(last.begin(), last.end(), extents.end() - std::ssize(last)))
        fail<FileError>(path(), ": \"", name, "\" is ", tensor.shape(), ", expected ", form);
    return tensor;
}

std::vector<std::int32_t> HeadTensors::indices(const std::string& name, const Tensor& tensor,
                                               std::int64_t count) const {
    std::vector<std::int32_t> result;
    for (const float value : tensor.values<float>()) {
        if (!(value >= 0.0F) || !(value < static_cast<float>(count)))
            fail<FileError>(path(), ": \"", name, "\" names number ", value, " of ", count);
        result.push_back(static_cast<std::int32_t>(value));
    }
    return result;
}

std::vector<std::array<std::int32_t, 3>> HeadTensors::triangles(const std::string& name,
                                                                std::int64_t vertex_count) const {
    const std::vector<std::int32_t> corners =
        indices(name, take(name, 2, {3}, "(T, 3)"), vertex_count);
    std::vector<std::array<std::int32_t, 3>> result(corners.size() / 3);
    for (std::size_t i = 0; i < corners.size(); ++i) result[i / 3][i % 3] = corners[i];
    return result;
}

std::array<std::int32_t, 68> HeadTensors::landmarks(std::int64_t vertex_count) const {
    const std::vector<std::int32_t> vertices =
        indices("landmarks68", take("landmarks68", {68}), vertex_count);
    std::array<std::int32_t, 68> result{};
    std::ranges::copy(vertices, result.begin());
    return result;
}

}  // namespace stymo::morphable
