#pragma once

#include <optional>
#include <vector>

#include "nn/models/face_batch.h"
#include "render/morphable/face_surface.h"

namespace stymo {

/// The linear heads that were fitted to the photos of a batch, as targets for the depth of the
/// rendered faces. Colours alone leave the depth of a frontal face open.
class HeadDepth {
public:
    /// `head` is the model to which the faces' codes belong and must outlive this object; null:
    /// there are no targets. Faces without a code have none either.
    HeadDepth(const MorphableHead* head, const FaceBatch& faces);

    /// Whether no row has a target.
    [[nodiscard]] bool empty() const;
    /// Moves the head of a row, if it has one, to where a depth map of the rendered face has the
    /// face.
    void align(std::int64_t row, const Camera& camera, const Tensor& depths);
    /// The face of a row as a camera sees it, with `side` rays along each side of the image. Empty
    /// for a row without a target.
    [[nodiscard]] std::optional<FaceSurface> surface(std::int64_t row, const Camera& camera,
                                                     std::int64_t side) const;
    /// Mean |depth - surface| on the face in units of the distance of the eyes, a scalar. `depth`
    /// is row `row` of `expected_depth` (nn/realtime/view.h).
    [[nodiscard]] Variable loss(const Variable& depth, const FaceSurface& surface,
                                std::int64_t row) const;

private:
    struct Head {
        Tensor fitted;   ///< vertices (V, 3), where the fit to the photo left them
        Tensor aligned;  ///< the same after `align`
        double eye_distance = 0.0;
    };
    static std::size_t index(std::int64_t row) { return static_cast<std::size_t>(row); }

    const MorphableHead* model_;
    std::vector<std::optional<Head>> heads_;  ///< by the rows of the batch
};

/// The depth map with the surface's depth on the face.
[[nodiscard]] Tensor with_surface(Tensor depths, const FaceSurface& surface);

}  // namespace stymo
