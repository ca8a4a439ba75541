#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "render/morphable/arkit_shapes.h"

namespace stymo {

/// The x that minimises |A x - b|^2, given A^T A and A^T b, with x[i] >= 0 unless `free` has i
/// (Lawson and Hanson 1974). x[i] is 0 where A^T A has a zero on its diagonal.
[[nodiscard]] Eigen::VectorXd non_negative_solution(const Eigen::MatrixXd& gram,
                                                    const Eigen::VectorXd& moment,
                                                    const std::vector<bool>& free);

/// Converts the expression code of a head to coefficients of ARKit's shapes and back, so that the
/// vertices move as alike as they can: both are non-negative least squares.
class ArkitConversion {
public:
    explicit ArkitConversion(const MorphableHead& head);

    [[nodiscard]] const ArkitShapes& shapes() const { return shapes_; }
    /// The 52 coefficients, >= 0, of an expression code (79). Shapes that are missing are 0.
    [[nodiscard]] std::vector<double> coefficients(std::span<const float> code) const;
    /// The expression code (79) of 52 coefficients.
    [[nodiscard]] std::vector<float> code(std::span<const double> coefficients) const;
    /// Root mean square, over the vertices, of their displacement by `code`, in world units.
    [[nodiscard]] double size(std::span<const float> code) const;
    /// The same of the difference between the displacements by both.
    [[nodiscard]] double difference(std::span<const float> code,
                                    std::span<const double> coefficients) const;

private:
    ArkitShapes shapes_;
    std::vector<bool> two_sided_;  ///< expressions that may be negative
    double vertices_ = 0.0;
    /// Products of the displacements by expressions and by shapes.
    Eigen::MatrixXd expressions_, both_, arkit_;
};

}  // namespace stymo
