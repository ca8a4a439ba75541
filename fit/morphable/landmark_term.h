#pragma once

#include <array>
#include <span>

#include "fit/morphable/least_squares.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/morphable/vertex_table.h"

/// Not part of the public interface.
namespace stymo::morphable {

/// The landmark term of the cost: a robust (Huber-like) loss of their distances in units of the
/// detector's deviation, quadratic up to 2.5 units and linear beyond.
class LandmarkTerm {
public:
    /// `landmarks` in units of the image side; those that are `guessed` count less.
    LandmarkTerm(const Contour& contour, Landmarks landmarks, const Intrinsics& intrinsics,
                 const MorphableFitOptions& options, const std::array<bool, 68>& guessed = {});

    /// Chooses the points of the outline and the weights for this state. They stay fixed until the
    /// next call.
    void hold(std::span<const double> state);
    void add_to(NormalEquations& equations, std::span<const double> state) const;
    [[nodiscard]] double cost(std::span<const double> state) const;
    /// The landmarks of the head with the chosen outline, in units of the image side.
    [[nodiscard]] Landmarks fitted(std::span<const double> state) const;
    /// Excludes or includes the points of the jaw.
    void use_jaw(bool use) { first_ = use ? 0 : 17; }

private:
    const Contour* contour_;
    Landmarks landmarks_;
    Intrinsics intrinsics_;
    std::array<double, 68> deviations_{};
    std::array<std::size_t, 68> rows_{};
    std::array<double, 68> weights_{};
    std::size_t first_ = 0;
};

/// The pose (state.h) for which the mean head's inner landmarks (17 to 67) are closest to the given
/// ones, in units of the image side: the best affine camera, reduced to a rotation and a scale.
/// Throws ValueError for landmarks that are not finite or are collinear.
[[nodiscard]] std::array<double, 6> affine_pose(const Contour& contour, const Landmarks& landmarks,
                                                const Intrinsics& intrinsics);

}  // namespace stymo::morphable
