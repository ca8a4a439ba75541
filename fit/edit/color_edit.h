#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "nn/models/model.h"

namespace stymo {

/// What is to have the wanted colour.
enum class ColorTerm {
    pixels,  ///< each pixel of the part, as in the paper, which flattens its light and shade, too
    mean,    ///< the mean of the part, whose light and shade are left as they like
};

struct ColorEditOptions {
    ColorTerm term = ColorTerm::mean;
    std::int64_t steps = 200;
    double learning_rate = 0.03;
    double decay = 0.99;  ///< factor on the learning rate after each step
    /// Weight of the squared texture offset; the model's own
    /// (ReconstructionConfig::fit_regularizer) if negative.
    double regularizer = -1.0;
    double rest_weight = 2.0;          ///< of L_rest beside L_color; the paper's is 1
    std::int64_t samples_per_ray = 0;  ///< 0: the model's own
    /// Called after each step with the number of steps done and the loss.
    std::function<void(std::int64_t, double)> on_step = {};
};

struct ColorEdit {
    Codes codes;                 ///< the face's, with another texture
    Tensor before;               ///< (S, S, 3) in [0, 1]
    Tensor after;                ///< likewise
    std::vector<double> losses;  ///< before each step
};

/// The paper's editing of a part's colour: Adam on an offset of the texture code alone that starts
/// at zero, with L_color + rest_weight L_rest + regularizer |offset|^2. L_color is the squared
/// distance of the pixels of the part (or of their mean) from `color`, L_rest that of all others
/// from what they were, both in the decoder's range [-1, 1], summed over RGB, averaged over the
/// pixels. Texture does not enter the field: it is rendered once, and a step costs the render
/// blocks. `part` is (S, S, 1) in [0, 1], `color` in [0, 1]. Throws ShapeError for another shape,
/// ValueError for a part without pixels, NumericError if the loss becomes non-finite.
[[nodiscard]] ColorEdit edit_color(const Model& model, const Codes& codes, const Camera& camera,
                                   const Tensor& part, const Eigen::Vector3d& color,
                                   const ColorEditOptions& options);

/// Mean colour of an image (S, S, 3) under a mask (S, S, 1).
[[nodiscard]] Eigen::Vector3d mean_color(const Tensor& image, const Tensor& mask);
/// Mean of |a - b| over the pixels of a mask and over RGB; 0 under an empty mask.
[[nodiscard]] double mean_difference(const Tensor& a, const Tensor& b, const Tensor& mask);
/// 1 - |after - target| / |before - target|: which share of the way to the target was gone. 1 where
/// there was none to go.
[[nodiscard]] double share_of_way(const Eigen::Vector3d& before, const Eigen::Vector3d& after,
                                  const Eigen::Vector3d& target);

}  // namespace stymo
