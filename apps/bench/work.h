#pragma once

#include <cstdint>
#include <string>

#include "nn/models/model.h"

/// Multiply-adds of the matrix products and convolutions, which are nearly all of the arithmetic.
namespace stymo {

/// The work of one frame.
struct FrameWork {
    double field_sample = 0.0;  ///< the field at one sample
    double ray = 0.0;           ///< the field's last layer, after compositing
    double blocks = 0.0;        ///< all render blocks, on every pixel
    double rays = 0.0;          ///< number of rays

    /// The work of the field with every sample.
    [[nodiscard]] double of_field(std::int64_t samples_per_ray) const;
    [[nodiscard]] double of_frame(std::int64_t samples_per_ray) const {
        return of_field(samples_per_ray) + blocks;
    }
};

/// `resolution` 0: the model's resolution.
[[nodiscard]] FrameWork frame_work(const Model& model, std::int64_t resolution = 0);
/// One forward pass of LPIPS' trunk on one square image.
[[nodiscard]] double trunk_work(const std::string& network, std::int64_t side);
/// One forward pass of a discriminator of images of this side.
[[nodiscard]] double discriminator_work(const ParameterStore& discriminator,
                                        const std::string& prefix, std::int64_t side);

}  // namespace stymo
