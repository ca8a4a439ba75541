#pragma once

#include <vector>

#include "nn/layer_memory.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"

namespace stymo {

/// What a CodeCorrector reads: the gradients (1, 306) of two errors of a batch of one face with
/// respect to its codes (1, 306). The second is there if the encoder knows faces.
/// 1. The mean squared difference of the rendered images from the targets, summed over the sides,
///    and a tenth of the cross-entropy of the opacity (opacity_error).
/// 2. At the largest side a tenth of the negative cosine of the embeddings by the identity
///    backbone, and 0.3 of the distance of the backbone's activations (EncoderDistance), if it has
///    them.
/// Unknown pixels count as equal.
[[nodiscard]] std::vector<Tensor> correction_gradients(const Model& model, const FaceBatch& face,
                                                       const Tensor& codes);

/// The codes of the batch's faces after EncoderConfig::corrections corrections. Each of them
/// renders a face and compares it with its targets up to a side of 128 pixels. Faces whose camera
/// the model cannot render keep their codes.
[[nodiscard]] Codes corrected(const Model& model, const FaceBatch& batch, const Codes& codes);

/// Memory of a correction, one face at a time.
[[nodiscard]] LayerMemory correction_memory(const Model& model);

}  // namespace stymo
