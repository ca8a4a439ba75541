#pragma once

#include <array>
#include <span>

#include "fit/morphable/contour.h"
#include "fit/morphable/least_squares.h"
#include "fit/morphable/morphable_fit.h"

/// Not part of the public interface.
namespace stymo::morphable {

/// The part of the cost that landmarks are: their squared distances, in units of what a detector
/// errs by, growing linearly from 2.5 of these units on.
class LandmarkTerm {
public:
    /// `landmarks` in units of the image side.
    LandmarkTerm(const Contour& contour, Landmarks landmarks, const Intrinsics& intrinsics,
                 const MorphableFitOptions& options);

    /// Chooses the points of the outline and the weights for this state, until it is called again.
    void hold(std::span<const double> state);
    void add_to(NormalEquations& equations, std::span<const double> state) const;
    [[nodiscard]] double cost(std::span<const double> state) const;
    /// Where the head has the landmarks, with the outline held, in units of the image side.
    [[nodiscard]] Landmarks fitted(std::span<const double> state) const;
    /// Leaves the jaw out, or takes it in again.
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

/// The numbers of the pose that shows the mean head's inner landmarks (17 to 67) where they are
/// given, in units of the image side: the best affine camera, made a rotation and a scale. Throws
/// ValueError for landmarks that are not finite or lie all on one line.
[[nodiscard]] std::array<double, 6> affine_pose(const Contour& contour, const Landmarks& landmarks,
                                                const Intrinsics& intrinsics);

}  // namespace stymo::morphable
