#pragma once

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// What the pixels of a crop say about covers and light. A difference is the distance of two
/// median colours in (log R/G, log B/G, 0.3 log brightness), where 0.1 is added to each channel, so
/// that the noise of dark skin counts for little.
struct PhotoLook {
    /// The smallest difference of mouth and chin from the skin of the brows, the forehead and below
    /// the eyes: above 0.25 under most masks.
    double lower_face = 0.0;
    /// The smallest difference of what is in and just below the eyes from nose, cheeks and the skin
    /// between the brows: above 0.25 behind most sunglasses.
    double eyes = 0.0;
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
/// Places with an unknown pixel are not compared; `known` (S, S, 1) as in nn/known_pixels.h.
[[nodiscard]] PhotoLook look_of(const Tensor& image, const Tensor& mask, const Landmarks& landmarks,
                                const Tensor& known = {});

}  // namespace stymo
