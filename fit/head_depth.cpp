#include "fit/head_depth.h"

#include <algorithm>

#include "core/ops/ops.h"
#include "nn/losses.h"

namespace stymo {

namespace {

/// Row `row` of a (B, size) code as float32 numbers.
Tensor code_of(const Tensor& codes, std::int64_t row) {
    return slice(Variable(codes), 0, row, row + 1).value().to(DType::float32);
}

}  // namespace

HeadDepth::HeadDepth(const MorphableHead* head, const FaceBatch& faces)
    : model_(head), heads_(faces.cameras.size()) {
    if (model_ == nullptr || !faces.has_codes()) return;
    const std::vector<double> present = faces.code_present.to_vector();
    for (std::size_t row = 0; row < heads_.size(); ++row) {
        if (present[row] == 0.0) continue;
        const auto number = static_cast<std::int64_t>(row);
        const Tensor identity = code_of(faces.codes[0], number);
        const Tensor expression = code_of(faces.codes[1], number);
        const Tensor vertices =
            head_vertices(*model_, identity.values<float>(), expression.values<float>());
        const double eyes = eye_distance(*model_, vertices);
        heads_[row] = Head{vertices, vertices, eyes};
    }
}

bool HeadDepth::empty() const {
    return std::ranges::none_of(heads_, [](const auto& head) { return head.has_value(); });
}

void HeadDepth::align(std::int64_t row, const Camera& camera, const Tensor& depths) {
    std::optional<Head>& head = heads_.at(index(row));
    if (head) head->aligned = moved_to_depth(*model_, head->fitted, camera, depths);
}

std::optional<FaceSurface> HeadDepth::surface(std::int64_t row, const Camera& camera,
                                              std::int64_t side) const {
    const std::optional<Head>& head = heads_.at(index(row));
    if (!head) return std::nullopt;
    return face_surface(*model_, head->aligned, camera, side);
}

Variable HeadDepth::loss(const Variable& depth, const FaceSurface& surface,
                         std::int64_t row) const {
    return depth_loss(depth, surface.depth.to(depth.dtype()), surface.face.to(depth.dtype())) /
           heads_.at(index(row))->eye_distance;
}

Tensor with_surface(Tensor depths, const FaceSurface& surface) {
    const std::span<float> values = depths.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        if (surface.face.values<float>()[i] > 0.0F) values[i] = surface.depth.values<float>()[i];
    return depths;
}

}  // namespace stymo
