#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/parsing_classes.h"

namespace stymo {

/// A set of parts of a head, in the order of `ParsingClass`.
using ParsingClassSet = std::array<bool, parsing_class_count>;

/// 1 where `classes` (H, W, 1), the result of FaceParser::parse, is one of the parts, else 0.
[[nodiscard]] Tensor part_mask(const Tensor& classes, const ParsingClassSet& parts);

/// The parts of `is_head_class`.
[[nodiscard]] ParsingClassSet head_of_parts();

/// The part of an image that a user points at, found without a face parser: a mask (S, S, 1), 1 on
/// the connected pixels whose colour is close to that around the point, else 0. `image` is (S, S,
/// 3) in [0, 1]; x (right) and y (down) are in [0, 1]; `reach` scales the largest distance in
/// CIELAB of close colours. Throws ShapeError for another shape, ValueError for a point outside the
/// image or a reach that is not positive.
[[nodiscard]] Tensor region_at(const Tensor& image, double x, double y, double reach = 1.0);

/// The quantity that should get the wanted colour.
enum class ColorTerm {
    pixels,  ///< each pixel of the part, as in the paper; this also flattens its shading
    mean,    ///< the mean of the part; its shading is not constrained
};

struct ColorEditOptions {
    ColorTerm term = ColorTerm::mean;
    std::int64_t steps = 200;
    double learning_rate = 0.03;
    double decay = 0.99;  ///< factor on the learning rate after each step
    /// Weight of the squared texture offset; if negative, the model's
    /// ReconstructionConfig::fit_regularizer.
    double regularizer = -1.0;
    double rest_weight = 2.0;          ///< weight of L_rest; 1 in the paper
    std::int64_t samples_per_ray = 0;  ///< 0: ReconstructionConfig::fit_samples_per_ray
    /// Called after each step with the number of steps done and the loss.
    std::function<void(std::int64_t, double)> on_step = {};
};

/// Sets learning rate and regularizer so that the codes stay close to those of real faces, even for
/// a colour that no face has: both are scaled by the variation of the training faces' textures.
/// Leaves them for a model without code statistics.
void keep_near_faces(const Model& model, ColorEditOptions& options);

struct ColorEdit {
    Codes codes;                 ///< the codes of the face with another texture
    Tensor before;               ///< (S, S, 3) in [0, 1]
    Tensor after;                ///< likewise
    std::vector<double> losses;  ///< before each step
};

/// The function that editing of a part's colour minimises: L_color + rest_weight L_rest +
/// regularizer |offset|^2 of an offset (1, 100) of the texture code. L_color is the squared
/// distance of the part's pixels (or of their mean) from `color`; L_rest is the squared distance of
/// all other pixels from their original values. Both are in the decoder's range [-1, 1], summed
/// over RGB and averaged over the pixels. Texture does not enter the field, so the field is
/// rendered once, and an evaluation runs only the render blocks.
class ColorObjective {
public:
    /// `part` is (S, S, 1) in [0, 1], `color` is RGB in [0, 1]. The model must outlive the
    /// objective. Throws ShapeError for another shape, ValueError for a part without pixels.
    ColorObjective(const Model& model, const Codes& codes, const Camera& camera, const Tensor& part,
                   const Eigen::Vector3d& color, const ColorEditOptions& options);

    [[nodiscard]] Variable loss(const Variable& offset) const;
    [[nodiscard]] Codes codes(const Variable& offset) const;
    /// (1, S, S, 3) in the decoder's range.
    [[nodiscard]] Variable image(const Variable& offset) const;
    /// Without an offset.
    [[nodiscard]] const Variable& original() const { return original_; }

private:
    const Model& model_;
    Codes codes_;
    DecodeOptions decode_;
    Variable feature_map_;
    Variable original_;
    Tensor part_;
    Tensor rest_;
    Variable wanted_;
    ColorTerm term_;
    double rest_weight_;
    double regularizer_;
};

/// The paper's editing of a part's colour: Adam minimises the ColorObjective of these arguments
/// from an offset of zero. Throws what it throws, and NumericError if the loss becomes non-finite.
[[nodiscard]] ColorEdit edit_color(const Model& model, const Codes& codes, const Camera& camera,
                                   const Tensor& part, const Eigen::Vector3d& color,
                                   const ColorEditOptions& options);

/// Mean colour of an image (S, S, 3) under a mask (S, S, 1).
[[nodiscard]] Eigen::Vector3d mean_color(const Tensor& image, const Tensor& mask);
/// Mean of |a - b| over the pixels of a mask and over RGB; 0 under an empty mask.
[[nodiscard]] double mean_difference(const Tensor& a, const Tensor& b, const Tensor& mask);
/// 1 - |after - target| / |before - target|: the share of the distance to the target that was
/// covered; 1 if `before` equals the target.
[[nodiscard]] double share_of_way(const Eigen::Vector3d& before, const Eigen::Vector3d& after,
                                  const Eigen::Vector3d& target);

}  // namespace stymo
