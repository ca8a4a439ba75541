#pragma once

#include <optional>
#include <vector>

#include "nn/layer_memory.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"
#include "nn/models/reconstruction.h"

namespace stymo {

/// A photo of a face, as corrections compare renderings with it. What does not depend on the codes
/// is computed once.
class CorrectionTarget {
public:
    /// Face `row` of the batch. The model must outlive this object.
    CorrectionTarget(const Model& model, const FaceBatch& batch, std::int64_t row);

    [[nodiscard]] const Camera& camera() const { return face_.cameras.front(); }
    /// What a CodeCorrector reads: the gradients (1, 306) of two errors with respect to codes
    /// (1, 306). The second is there if the encoder knows faces.
    /// 1. The mean squared difference of the rendered images from the targets, summed over the
    ///    sides up to 128, and a tenth of the cross-entropy of the opacity (opacity_error).
    /// 2. At the largest of these sides a tenth of the negative cosine of the embeddings by the
    ///    identity backbone, and 0.3 of the distance of the backbone's activations
    ///    (EncoderDistance), if it has them.
    /// Unknown pixels count as equal.
    [[nodiscard]] std::vector<Tensor> gradients(const Tensor& codes) const;

private:
    [[nodiscard]] Variable image_error(const Decoded& decoded) const;
    [[nodiscard]] Variable feature_error(const Decoded& decoded) const;
    /// The rendered image, black where the photo is unknown.
    [[nodiscard]] Variable with_known(const Variable& image) const;

    const Model& model_;
    FaceBatch face_;
    Variable embedding_;                       ///< undefined if the encoder knows no faces
    std::optional<EncoderDistance> distance_;  ///< with `features_`, if it also has activations
    PerceptualDistance::Features features_;
};

/// The codes of the batch's faces after EncoderConfig::corrections corrections. Each of them
/// renders a face and compares it with its targets up to a side of 128 pixels, or with the smallest
/// one if that is larger: also where the codes come from another photo of the person
/// (read_people_from), whose codes are corrected towards the photo that they have to render. Faces
/// whose camera the model cannot render keep their codes.
[[nodiscard]] Codes corrected(const Model& model, const FaceBatch& batch, const Codes& codes);

/// Memory of a correction, one face at a time.
[[nodiscard]] LayerMemory correction_memory(const Model& model);

}  // namespace stymo
