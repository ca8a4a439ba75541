#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "fit/photo/photo_preparation.h"
#include "nn/models/face_batch.h"
#include "nn/models/model.h"

namespace stymo {

/// A photo that is ready to be fitted, and the results of its preparation.
struct PreparedPhoto {
    Face face;  ///< at the model's resolution
    /// The crop; its side is 512 pixels or the model's resolution if that is larger.
    Tensor aligned;
    Tensor overlay;  ///< the crop with all results drawn over it
    std::vector<std::string> warnings;
    std::int64_t faces = 1;  ///< as in FaceCrop
};

/// The central square of an image, resized to side x side pixels.
[[nodiscard]] Tensor at_model_side(const Tensor& image, std::int64_t side);

/// These settings with the sides, the camera and the crop that photos for this model have.
[[nodiscard]] PhotoPreparationSettings settings_for(const ModelConfig& model,
                                                    PhotoPreparationSettings settings);
/// The smallest side of the decoder's images that loses no pixel of any of the photos, the largest
/// one if there is none or if it is not known how many pixels they have.
[[nodiscard]] std::int64_t compared_side(const DecoderConfig& decoder, std::span<const Face> faces);
/// A prepared face, which did not fail, as a face for the model; `settings` are those of the model.
[[nodiscard]] Face face_of_crop(const PreparedFace& prepared,
                                const PhotoPreparationSettings& settings, const ModelConfig& model);
/// Finds, aligns and masks the face of each photo, with its pose for the model's camera.
/// `preparation` has the `settings_for` the model. Throws FileError, which names the photo, for a
/// photo that cannot be read or used. `known` are the known pixels of each photo, as in
/// KnownOfPhoto.
[[nodiscard]] std::vector<PreparedPhoto> prepare_photos(std::span<const std::string> images,
                                                        const ModelConfig& model,
                                                        const PhotoPreparation& preparation,
                                                        const Tensor& known = {});

/// The same for one photo in memory, (height, width, 3) in [0, 1], which messages call `name`.
[[nodiscard]] PreparedPhoto prepare_photo(const Tensor& photo, const std::string& name,
                                          const ModelConfig& model,
                                          const PhotoPreparation& preparation);

}  // namespace stymo
