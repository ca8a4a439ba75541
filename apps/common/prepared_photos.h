#pragma once

#include <span>
#include <string>
#include <vector>

#include "fit/photo/photo_preparation.h"
#include "nn/models/model.h"
#include "train/data/batch.h"

namespace stymo {

/// A photo that is ready to be fitted, and the results of its preparation.
struct PreparedPhoto {
    Face face;       ///< at the model's resolution
    Tensor aligned;  ///< the crop, 512 pixels a side or the model's if that is more
    Tensor overlay;  ///< everything found, drawn over it
    std::vector<std::string> warnings;
};

/// Finds, aligns and masks the largest face of each photo, with its pose for the model's camera.
/// `settings`: the files to work with, and the model whose heads guide the masks. Throws FileError
/// naming the photo that cannot be read or used.
[[nodiscard]] std::vector<PreparedPhoto> prepare_photos(std::span<const std::string> images,
                                                        const ModelConfig& model,
                                                        PhotoPreparationSettings settings);

}  // namespace stymo
