#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"
#include "nn/pretrained/landmark_network.h"

namespace stymo {

/// What the pixels of a crop say about covers and light.
struct PhotoLook {
    FaceCovers covers{};  ///< 0 where pixels are unknown
    /// The median of the head mask at the mouth, and the lower one of both eyes (that of the nearer
    /// one in a profile): the head-mask network leaves cloth, phones and many sunglasses out.
    double mouth_in_mask = 1.0;
    double eyes_in_mask = 1.0;
    double brightness = 1.0;  ///< 99th percentile of the mean of RGB
    /// Of the middle of the face, a disc around the nose: the noise's standard deviation in units
    /// of the brightness (Immerkaer 1996, with a median), up to 0.028 in 2,124 good portraits, and
    /// the share of pixels with a channel above 0.99, or without one above 0.01.
    double noise = 0.0;
    double clipped = 0.0;
};

/// `image` (S, S, 3), `mask` (S, S, 1), `landmarks` in pixels; noise is that of a side of 256.
/// `known` (S, S, 1) as in nn/known_pixels.h; what is unknown at the mouth or an eye is no cover.
[[nodiscard]] PhotoLook look_of(const Tensor& image, const Tensor& mask, const Landmarks& landmarks,
                                const Tensor& known = {}, const FaceCovers& covers = {});

}  // namespace stymo
