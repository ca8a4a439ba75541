#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/camera.h"

namespace stymo {

/// One photo at the training size S, with its data.
struct Face {
    std::string id;
    std::string source{};  ///< of photos of one look; empty: of none that is known
    Tensor image;          ///< (S, S, 3) in [0, 1], unmasked
    Tensor mask;           ///< (S, S, 1) in [0, 1], 1 on the head; 1 everywhere if there is none
    Tensor known{};        ///< (S, S, 1), see nn/known_pixels.h; undefined: all pixels are known
    Pose pose;             ///< frontal if there is none
    Intrinsics intrinsics;
    std::int64_t photo_side = 0;  ///< side of the image in pixels of its photo; 0: not known
    std::vector<float> code;      ///< the 306 elements of a morphable model's fit, or empty
    bool is_mirrored = false;
    bool has_mask = false;
    bool has_pose = false;
    bool has_code = false;
};

/// The mirror image of a face. It has no code, because the code of a mirrored face is unknown.
[[nodiscard]] Face mirrored(const Face& face);

/// What two photos of a person have in common. Each has what those before it have.
enum class Shared {
    person,  ///< identity and texture
    light,   ///< and the light
    all,     ///< and the expression: only the camera differs
};

/// Photos of B faces, prepared for the networks and the losses of training and fitting.
struct FaceBatch {
    Tensor input;  ///< (B, S, S, 3) in [-1, 1], unmasked: what the encoder sees
    /// (B, R, R, 3) in [-1, 1] for each side R that is compared, in ascending order from the least
    /// that the model renders: the head on a black background (-1).
    std::vector<Tensor> targets;
    std::vector<Camera> cameras;
    std::vector<std::string> ids{};
    std::vector<std::string> sources{};  ///< of each face, as in Face; empty: of none
    std::vector<bool> mirrored{};  ///< whether a face is the mirror image of its photo; empty: none
    std::vector<bool> has_mask{};  ///< of each face, as in Face; empty: none
    Tensor mask{};                 ///< (B, S, S, 1) in [0, 1], 0 where a pixel is unknown
    Tensor ray_mask{};  ///< (B, R, R, 1) in [0, 1], one value for each ray; R is half the smallest
                        ///< target's side
    std::array<Tensor, 4> codes{};  ///< (B, size) of each group in the order of `code_names`, zeros
                                    ///< where a face has no code
    Tensor code_present{};          ///< (B), 1 where a face has a code; undefined: no face has one
    /// (B, S, S, 3) like `input`: photos that show the same people, from which the encoder reads
    /// what they share with the faces; undefined: the faces' own photos.
    Tensor other_input{};
    std::vector<Camera> other_cameras{};  ///< of these photos
    std::vector<Shared> shared{};

    /// (B, S, S, 1), see nn/known_pixels.h; undefined: all pixels are known. Unknown pixels are
    /// guessed in `input` (with_guesses) and -1 in `targets`, whatever the photos have there.
    Tensor known{};

    /// The known pixels of a row, (1, S, S, 1); undefined if all are.
    [[nodiscard]] Tensor known_of(std::int64_t row) const;
    /// Whether a row of `mask` is that of a photo, not 1 everywhere.
    [[nodiscard]] bool has_mask_of(std::int64_t row) const;
    /// Whether any face of the batch has a code.
    [[nodiscard]] bool has_codes() const;
};

/// Makes a batch. For the targets each image is multiplied by its mask, mapped to [-1, 1],
/// downsampled by antialiased bicubic resampling and clipped to [-1, 1]. The targets' sides are
/// `smallest_target` doubled up to `largest_target` (0: the faces' side). Throws ValueError for no
/// faces or a largest side that is none of them, ShapeError for faces of different sides or a side
/// that doubling does not reach.
[[nodiscard]] FaceBatch make_batch(std::span<const Face> faces, std::int64_t smallest_target = 64,
                                   std::int64_t largest_target = 0);

/// Lets the encoder read what is shared from `others`, photos of the same people, and the rest from
/// `own`, photos of the same moment as the faces: the code of one photo then has to render another.
/// Throws ShapeError for another number of faces.
void read_people_from(FaceBatch& batch, std::span<const Face> own, std::span<const Face> others,
                      std::vector<Shared> shared);

/// Cross-entropy of the opacity of the rays against the batch's masks (opacity_loss).
[[nodiscard]] Variable opacity_error(const Decoded& decoded, const FaceBatch& batch);

/// Initial codes of the batch's faces in Z: from the encoder with its corrections
/// (nn/models/code_correction.h), or from `batch.codes` if the model
/// has no encoder. Throws ValueError, which names the first face whose code is missing.
[[nodiscard]] Codes face_codes(const Model& model, const FaceBatch& batch);
/// The same without corrections: faster, and more alike for photos of one person.
[[nodiscard]] Codes uncorrected_codes(const Model& model, const FaceBatch& batch);

}  // namespace stymo
