#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>

#include "nn/models/model.h"
#include "nn/realtime/render_mode.h"
#include "nn/realtime/view.h"

namespace stymo {

/// docs/numerics.md has the error of its frames on the model that ships.
inline constexpr double default_tolerance = 0.25;

struct RendererOptions {
    RenderMode mode = RenderMode::skip;
    std::int64_t samples_per_ray = 64;
    std::int64_t resolution = 0;  ///< 0: the model's resolution
    /// Largest total compositing weight of consecutive samples that are left out where the ray is
    /// surely opaque, in [0, 1). Read by the modes that tolerate. What else they leave out shrinks
    /// with it too. The error of a tolerance depends on the face; `choose_renderer` measures it.
    double tolerance = default_tolerance;
    bool mask = false;
    bool depth = false;
    /// Removes pieces that are separate from the head (FloaterRemoval). Ignored if the model's
    /// decoder does not fold.
    bool remove_floaters = false;

    bool operator==(const RendererOptions&) const = default;
};

/// Amount of work of the last frame.
struct RenderCounts {
    std::int64_t samples = 0;        ///< of all rays
    std::int64_t field_samples = 0;  ///< of these, the samples at which the field was evaluated
    std::int64_t grid_points = 0;    ///< points at which a density grid was evaluated for the frame
    std::int64_t tiles = 0;          ///< tiles in which the field was evaluated
    std::int64_t pixels = 0;         ///< of all render blocks, each at its own resolution
    std::int64_t pixels_computed = 0;
    std::int64_t layers = 0;  ///< of the field, of all render blocks and of the mask branch
    /// Of these, the layers that were evaluated for more than the background's one pixel.
    std::int64_t layers_computed = 0;
    /// Number of times that weights were folded for new codes, since the renderer was made.
    std::int64_t folds = 0;
};

/// What `FaceRenderer::render` computes.
enum class FrameParts {
    all,    ///< what RendererOptions asks for
    field,  ///< depth and opacity alone; no render block runs
};

/// Renders one face of a trained model from many sides. It folds the layers once for new codes and
/// keeps all that does not change between frames. The density grid is kept while identity and
/// expression stay the same; `render` evaluates it where a view needs it. The feature map is kept
/// while, in addition, the camera and the tolerance stay the same. Rendering allocates no memory if
/// the density grid covers the view and the previous View was destroyed.
///
/// There is no density outside the volume that training cameras see (field_source.h).
class FaceRenderer {
public:
    /// The model must outlive the renderer. If its decoder does not fold, frames are those of
    /// `decoded_view`. Throws ValueError for fewer than 2 samples per ray, a tolerance outside [0,
    /// 1), a resolution that the model does not have, and for a mode other than exact if the
    /// decoder does not fold.
    FaceRenderer(const Model& model, const RendererOptions& options);
    ~FaceRenderer();
    FaceRenderer(FaceRenderer&&) noexcept;

    /// Sets the face: row `index` of codes in Z. Groups that have not changed cost nothing. Throws
    /// ShapeError for codes of another shape or an index outside them.
    void show(const Codes& codes, std::int64_t index = 0);
    /// Throws ValueError before the first `show`, NumericError for a view that is not finite.
    [[nodiscard]] View render(const Camera& camera);
    /// The same, but returns nothing if a stop is requested before the frame is complete. The
    /// request is checked before each tile of samples and before each strip of a render block. It
    /// is ignored if the decoder does not fold.
    [[nodiscard]] std::optional<View> render(const Camera& camera, const std::stop_token& stop,
                                             FrameParts parts = FrameParts::all);
    /// Replaces RendererOptions::tolerance. Keeps the density grid. Throws ValueError outside [0,
    /// 1).
    void set_tolerance(double tolerance);
    /// Counts of the last frame.
    [[nodiscard]] const RenderCounts& counts() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace stymo
