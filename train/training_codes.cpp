#include "train/training_codes.h"

#include <algorithm>
#include <vector>

#include "core/ops/ops.h"
#include "nn/models/face_batch.h"

namespace stymo {

namespace {

constexpr std::int64_t faces_at_once = 8;

}  // namespace

Codes encoded_faces(const Model& model, const Dataset& faces, std::int64_t most) {
    const std::int64_t count = std::min(most, faces.size());
    std::vector<Variable> rows;
    for (std::int64_t begin = 0; begin < count; begin += faces_at_once) {
        std::vector<std::int64_t> indices;
        for (std::int64_t i = begin; i < std::min(begin + faces_at_once, count); ++i)
            indices.push_back(i * faces.size() / count);
        rows.push_back(joined(detached(face_codes(
            model, make_batch(faces.load(indices), model.decoder().ladder().smallest())))));
    }
    return split_codes(concat(rows, 0));
}

std::optional<CodeStatistics> code_statistics_of(const Model& model, const Dataset& faces,
                                                 std::int64_t most) {
    if (std::min(most, faces.size()) < 2) return std::nullopt;
    const Codes codes = encoded_faces(model, faces, most);
    if (!joined(codes).value().all_finite()) return std::nullopt;
    return CodeStatistics::of(codes);
}

void add_code_statistics(const std::filesystem::path& model_file, const Dataset& faces,
                         std::int64_t most) {
    if (std::min(most, faces.size()) < 2 || !std::filesystem::exists(model_file)) return;
    const std::optional<CodeStatistics> statistics =
        code_statistics_of(Model::load(model_file), faces, most);
    if (!statistics) return;
    TensorFile file = read_tensor_file(model_file);
    statistics->save(file);
    write_tensor_file(model_file, file);
}

}  // namespace stymo
