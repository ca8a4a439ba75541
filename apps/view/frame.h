#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "core/tensor.h"
#include "nn/models/codes.h"
#include "nn/models/model.h"
#include "nn/realtime/face_renderer.h"
#include "render/camera.h"
#include "render/rays.h"

namespace stymo::view {

/// Surface normals of a depth map (R, R, 1) by central differences: unit vectors (R, R, 3) in world
/// axes that point towards the camera's side. `depth` holds the distance along each ray of
/// `sampling` (rays_per_side = R). A normal that cannot be determined is zero. Throws ShapeError
/// for a depth map of another size.
[[nodiscard]] Tensor depth_normals(const Tensor& depth, const Camera& camera,
                                   const RaySampling& sampling);

/// The quantity that a frame shows.
enum class Layer { image, depth, mask, normals };

/// `moving`: fast, with a limited error; `still`: exact; `thumbnail`: 64 pixels; `snapshot`: exact,
/// to be saved.
enum class Quality { moving, still, thumbnail, snapshot };

struct FrameRequest {
    std::shared_ptr<const Model> model;  ///< the tuned model if the face is tuned
    Codes codes;                         ///< one row
    Camera camera;
    Layer layer = Layer::image;
    Quality quality = Quality::moving;
};

/// A frame for the browser, with its settings and error.
struct Frame {
    std::string jpeg;
    double milliseconds = 0.0;  ///< time of rendering and encoding
    std::string mode;           ///< name_of(RenderMode)
    double tolerance = 0.0;
    std::int64_t side = 0;  ///< in pixels
    /// For a still frame, the PSNR in decibels of the moving frame of the same view.
    std::optional<double> moving_psnr{};
};

struct FrameSettings {
    RenderMode moving_mode = RenderMode::skip;
    double psnr = 45.0;  ///< wanted PSNR in decibels of moving frames and of films
    double tolerance = default_tolerance;  ///< of the first moving frames
    /// Moving frames that take longer are rendered at half their side (MovingSide).
    double most_moving_milliseconds = 33.0;
    int moving_jpeg_quality = 80;
    int still_jpeg_quality = 95;
};

/// Decides from the times of moving frames whether they are rendered at half their side.
class MovingSide {
public:
    /// If several consecutive frames take longer than `most_milliseconds`, frames are rendered at
    /// half their side, until frames of the whole side, which take at most four times as long,
    /// would be fast enough.
    explicit MovingSide(double most_milliseconds) : most_(most_milliseconds) {}

    [[nodiscard]] bool is_half() const { return is_half_; }
    /// Adds the time of a frame at the current side, without the time for creating its renderer.
    void take(double milliseconds);

private:
    void change_to(bool half);

    double most_;
    bool is_half_ = false;
    /// False after frames of half the side turned out to be hardly faster. If the field takes most
    /// of the time, they would only look worse.
    bool half_helps_ = true;
    int frames_ = 0;       ///< number of frames at the current side
    int slow_frames_ = 0;  ///< number of consecutive slow frames
    double mean_ = 0.0;
    double mean_of_whole_ = 0.0;  ///< mean time at the whole side when the side was last halved
};

/// Renders the frames of one viewer. It keeps the renderers of the face, so that a frame only costs
/// what has changed since the last one.
class FrameRenderer {
public:
    explicit FrameRenderer(const FrameSettings& settings);
    ~FrameRenderer();
    FrameRenderer(FrameRenderer&&) noexcept;

    /// The frame, or nothing if a stop is requested before it is complete. A still frame also
    /// measures the error of the moving frame of the same view, and adapts the tolerance to the
    /// wanted PSNR. It does not if moving frames are at half their side, which then dominates the
    /// error. Depth and normals run no render block, and another layer keeps all that is known of
    /// the face. Images have a soft edge.
    [[nodiscard]] std::optional<Frame> render(const FrameRequest& request,
                                              const std::stop_token& stop);

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace stymo::view
