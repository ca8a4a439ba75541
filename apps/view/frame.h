#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "nn/models/codes.h"
#include "nn/models/model.h"
#include "nn/models/realtime/face_renderer.h"
#include "render/camera.h"

namespace stymo::view {

/// What a frame shows of the face.
enum class Layer { image, depth, mask, normals };

/// `moving`: soon, with a stated error; `still`: exact; `thumbnail`: 64 pixels; `snapshot`: exact,
/// to be saved.
enum class Quality { moving, still, thumbnail, snapshot };

struct FrameRequest {
    std::shared_ptr<const Model> model;  ///< the face's own, where it is tuned
    Codes codes;                         ///< one row
    Camera camera;
    Layer layer = Layer::image;
    Quality quality = Quality::moving;
};

/// A frame as the browser shows it, and what is known of its error.
struct Frame {
    std::string jpeg;
    double milliseconds = 0.0;  ///< of rendering and encoding
    std::string mode;           ///< "exact", "skip", "half", "baked"
    double tolerance = 0.0;
    std::int64_t side = 0;  ///< in pixels
    /// Of a still frame: the PSNR of the moving frame of the same view, in decibels.
    std::optional<double> moving_psnr{};
};

struct FrameSettings {
    RenderMode moving_mode = RenderMode::skip;
    double psnr = 45.0;      ///< that moving frames are to have against exact ones
    double tolerance = 0.3;  ///< of the first moving frames
    /// Moving frames that take longer on average are made at half their side.
    double most_moving_milliseconds = 33.0;
    int moving_jpeg_quality = 80;
    int still_jpeg_quality = 95;
};

/// Draws the frames of one viewer. Keeps the renderers of its face, so that a frame costs what has
/// changed since the last one.
class FrameRenderer {
public:
    explicit FrameRenderer(const FrameSettings& settings);
    ~FrameRenderer();
    FrameRenderer(FrameRenderer&&) noexcept;

    /// The frame, or nothing if a stop is requested before it is complete. A still frame measures
    /// the error of the moving ones at this view and adapts their tolerance to the wanted PSNR,
    /// unless these are at half their side, where the side decides the error.
    [[nodiscard]] std::optional<Frame> render(const FrameRequest& request,
                                              const std::stop_token& stop);

private:
    struct State;
    std::unique_ptr<State> state_;
};

/// The faster of the modes `skip` and `half` on this machine for the model's mean face.
[[nodiscard]] RenderMode fastest_mode(const Model& model, const Codes& codes);

}  // namespace stymo::view
