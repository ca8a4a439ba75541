#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>

#include "nn/models/model.h"
#include "nn/models/view.h"

namespace stymo {

/// How a face is shown; all but `exact` leave out or shorten work, with an error that
/// docs/results.md states.
enum class RenderMode {
    exact,  ///< every sample, float32
    skip,   ///< float32, without samples and pixels that are insignificant at the tolerance
    half,   ///< as skip, with weights and activations of the faster type of 16 bits (precision.h)
    baked,  ///< the field sampled once for this head; views read it, with render blocks of half
            ///< precision where it is fast
};

struct RendererOptions {
    RenderMode mode = RenderMode::skip;
    std::int64_t samples_per_ray = 64;
    std::int64_t resolution = 0;  ///< 0: the model's own
    /// Compositing weight that samples left out in a row may have together; a ray of up to half of
    /// it counts as empty. Not of a bake. 0.3 gives 47 dB on average and 42 at worst against exact
    /// frames (trained field, docs/decisions.md).
    double tolerance = 0.3;
    std::int64_t bake_resolution = 96;  ///< cells along one side of the baked cube
    bool mask = false;
    bool depth = false;
    /// Empties rays that show pieces beside the head (floaters.h). Not of a model whose decoder
    /// does not fold.
    bool remove_floaters = false;
};

/// What the last frame did and left out.
struct RenderCounts {
    std::int64_t samples = 0;        ///< of all rays
    std::int64_t field_samples = 0;  ///< of them, through the field
    std::int64_t tiles = 0;          ///< of samples that went through the field together
    std::int64_t pixels = 0;         ///< of all render blocks, at their resolution
    std::int64_t pixels_computed = 0;
    std::int64_t layers = 0;  ///< of the model's field, all its render blocks and its mask branch
    std::int64_t layers_computed =
        0;                   ///< of them, for more than the one pixel that the background is
    std::int64_t folds = 0;  ///< of weights for new codes, since the renderer was made
};

/// Shows one face of a trained model from many sides. Folds the layers for the codes once, keeps
/// what does not change from frame to frame (density grid for identity and expression, evaluated
/// for the usual views when they are shown, for others when they are rendered; feature map while
/// neither they nor the camera change), and allocates nothing for a view whose surroundings have
/// been seen, once the view before is released.
class FaceRenderer {
public:
    /// The model outlives the renderer. Throws ValueError for a resolution or a number of samples
    /// that the model cannot render, and for a mode other than exact unless the model's decoder
    /// folds: without, frames are those of `decoded_view`.
    FaceRenderer(const Model& model, const RendererOptions& options);
    ~FaceRenderer();
    FaceRenderer(FaceRenderer&&) noexcept;

    /// The face of row `index` of codes in Z. Groups that equal the present ones cost nothing.
    void show(const Codes& codes, std::int64_t index = 0);
    /// Throws ValueError before the first `show`.
    [[nodiscard]] View render(const Camera& camera);
    /// The same, or nothing if a stop is requested before the frame is complete. It is looked for
    /// before each tile of samples and each strip of rows of a render block, but not in a model
    /// whose decoder does not fold.
    [[nodiscard]] std::optional<View> render(const Camera& camera, const std::stop_token& stop);
    [[nodiscard]] const RenderCounts& counts() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace stymo
