#pragma once

#include <functional>
#include <span>
#include <vector>

#include "fit/photo/landmarks.h"
#include "nn/models/model.h"
#include "nn/pretrained/landmark_network.h"
#include "render/morphable/head.h"
#include "render/turned_photo.h"

namespace stymo {

/// Renders a face (row 0 of `codes`) from the front and from `yaws` sides, each up to 12 degrees up
/// and down: by default from the views in which models know its surface well. Angles in radians.
/// `around_head` as in ViewRange. `observe` is told the share of the views that are rendered.
/// Throws ValueError if the density has no surface where the face should be.
[[nodiscard]] std::vector<SeenFace> surface_views(const Model& model, const Codes& codes,
                                                  double largest_yaw = 0.45, int yaws = 4,
                                                  bool around_head = false,
                                                  const std::function<void(double)>& observe = {});

/// A linear head in the place of a model's face.
struct LaidHead {
    Tensor vertices;                ///< (V, 3), world coordinates of the model
    std::vector<float> identity;    ///< 100 coefficients of the fitted head
    std::vector<float> expression;  ///< 79
    /// Turns and scales displacements of the head's vertices (expressions) as the head was.
    Eigen::Matrix3d world_from_head = Eigen::Matrix3d::Identity();
    Landmarks landmarks;  ///< found in the first view, in units of the image's side
};

/// Finds the landmarks of the first view, fits the head's pose, shape and expression to it
/// (`fit_morphable`) and moves it to the depth of the face. Throws ValueError if the landmarks do
/// not look like a face.
[[nodiscard]] LaidHead fitted_head(const MorphableHead& head, const LandmarkModel& landmarks,
                                   const SeenFace& frontal);

/// Lays the vertices onto the surface: those that a view sees go to its depth, those of an outline
/// to the outline of the view, landmarks to where they were found; the others follow their
/// neighbours. Pieces such as brows follow the skin, and eyeballs do so without changing shape.
void lay_on_surface(const MorphableHead& head, std::span<const SeenFace> views, LaidHead& laid);

/// The vertices without the fitted expression.
[[nodiscard]] Tensor neutral_vertices(const MorphableHead& head, const LaidHead& laid);

}  // namespace stymo
