#pragma once

#include <Eigen/Core>

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/morphable/head.h"

namespace stymo {

/// How the expression varies among faces with one identity code: C (79, 79) with C^T C the
/// covariance, so that u C is a change of expression for standard normal u. Undefined if the model
/// has no statistics of its codes, or those of fewer than 612 faces.
[[nodiscard]] Tensor expression_directions(const Model& model);

/// Draws changes of an expression code to what the model's faces do.
class PlausibleChanges {
public:
    PlausibleChanges(const Model& model, const MorphableHead& head);

    /// For a change d (1, 79), with u C the one that minimises |u|^2 plus the mean square of the
    /// distances, in half millimetres, between the vertices of `head` moved by d and by u C: g u C.
    /// That minimum is the right movement, but far too small: most vertices never move. The gain g
    /// lets it go as far along the wanted movement as d does; it is at most `largest_gain`, and
    /// bounded smoothly so that |g u| stays below `most_unusual`. A model without statistics
    /// changes nothing of d.
    [[nodiscard]] Tensor operator()(const Tensor& change) const;

    static constexpr double largest_gain = 5.0;
    static constexpr double most_unusual = 7.0;  ///< standard deviations

private:
    Eigen::MatrixXd units_;      ///< (79, 79): d -> u
    Eigen::MatrixXd distances_;  ///< (79, 79): d -> the squared movement of all vertices
    Tensor directions_;          ///< C; undefined without statistics
};

}  // namespace stymo
