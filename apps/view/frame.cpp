#include "apps/view/frame.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/clock.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/io/jpeg.h"
#include "nn/models/display_image.h"
#include "nn/realtime/chosen_tolerance.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"

namespace stymo::view {

Tensor depth_normals(const Tensor& depth, const Camera& camera, const RaySampling& sampling) {
    const std::int64_t side = sampling.rays_per_side;
    if (!(depth.shape() == Shape{side, side, 1}))
        fail<ShapeError>("[depth_normals] needs (", side, ", ", side, ", 1), got ", depth.shape());
    const std::vector<double> depths = depth.to_vector();
    std::vector<Eigen::Vector3d> points;
    points.reserve(depths.size());
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Eigen::Vector3d direction =
            camera.world_from_camera *
            camera_direction(camera.intrinsics, sampling, i / side, i % side);
        points.emplace_back(camera.center + depths[static_cast<std::size_t>(i)] * direction);
    }
    const auto point = [&](std::int64_t row, std::int64_t column) -> const Eigen::Vector3d& {
        const std::int64_t y = std::clamp<std::int64_t>(row, 0, side - 1),
                           x = std::clamp<std::int64_t>(column, 0, side - 1);
        return points[static_cast<std::size_t>(y * side + x)];
    };
    Tensor result({side, side, 3});
    const std::span<float> values = result.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const std::int64_t row = i / side, column = i % side;
        const Eigen::Vector3d right = point(row, column + 1) - point(row, column - 1);
        const Eigen::Vector3d down = point(row + 1, column) - point(row - 1, column);
        const Eigen::Vector3d normal = down.cross(right).stableNormalized();
        for (int axis = 0; axis < 3; ++axis)
            values[static_cast<std::size_t>(3 * i + axis)] = static_cast<float>(normal[axis]);
    }
    return result;
}

namespace {

constexpr std::int64_t thumbnail_side = 64;
constexpr double highest_psnr = 100.0;  ///< of equal frames
constexpr double least_tolerance = 0.001, largest_tolerance = 0.5;
/// The tolerance may grow if the PSNR exceeds the wanted one by this many decibels.
constexpr double psnr_to_spare = 3.0;

Tensor enlarged(const Tensor& map, std::int64_t side) {
    if (map.shape(0) == side) return map;
    return resize_image(map, static_cast<int>(side), static_cast<int>(side));
}

/// Near is yellow, far is violet (OpenCV's map "inferno"), over the depths of the head.
Tensor depth_picture(const View& view, std::int64_t side) {
    const std::vector<double> depths = view.depth.to_vector();
    const auto [nearest, farthest] = std::ranges::minmax(depths);
    const double scale = 255.0 / std::max(farthest - nearest, 1e-6);
    const auto rays = static_cast<int>(view.depth.shape(0));
    cv::Mat levels(rays, rays, CV_8U);
    for (int i = 0; i < rays * rays; ++i)
        levels.at<std::uint8_t>(i / rays, i % rays) = cv::saturate_cast<std::uint8_t>(
            (farthest - depths[static_cast<std::size_t>(i)]) * scale);
    cv::Mat colors;
    cv::applyColorMap(levels, colors, cv::COLORMAP_INFERNO);
    Tensor picture({rays, rays, 3});
    const std::span<float> values = picture.mutable_values<float>();
    for (int i = 0; i < 3 * rays * rays; ++i) {
        const auto& pixel = colors.at<cv::Vec3b>(i / 3 / rays, i / 3 % rays);
        values[static_cast<std::size_t>(i)] = static_cast<float>(pixel[2 - i % 3]) / 255.0F;
    }
    return enlarged(picture, side);
}

/// x, y, z of the normals in camera axes as red, green, blue. They fade to black with the opacity,
/// since outside the head depths are meaningless.
Tensor normals_picture(const View& view, const Camera& camera, const RaySampling& sampling,
                       std::int64_t side) {
    Tensor normals = depth_normals(view.depth, camera, sampling);
    const std::span<float> values = normals.mutable_values<float>();
    for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
        const Eigen::Vector3d normal(static_cast<double>(values[i]),
                                     static_cast<double>(values[i + 1]),
                                     static_cast<double>(values[i + 2]));
        const Eigen::Vector3d seen = camera.world_from_camera.transpose() * normal;
        values[i] = static_cast<float>(0.5 + 0.5 * seen[0]);
        values[i + 1] = static_cast<float>(0.5 - 0.5 * seen[1]);
        values[i + 2] = static_cast<float>(0.5 - 0.5 * seen[2]);
    }
    return enlarged(masked_image(normals, view.opacity), side);
}

Tensor picture_of(const View& view, const FrameRequest& request, std::int64_t side) {
    switch (request.layer) {
        case Layer::depth: return depth_picture(view, side);
        case Layer::mask: return view.mask;
        case Layer::normals:
            return normals_picture(view, request.camera, request.model->config().decoder.rays,
                                   side);
        case Layer::image: break;
    }
    return with_soft_edge(view.image, view.mask);
}

RendererOptions options_for(const FrameRequest& request, RenderMode mode, double tolerance) {
    RendererOptions options;
    options.mode = request.model->decoder().folds() ? mode : RenderMode::exact;
    options.tolerance = tolerates(options.mode) ? tolerance : 0.0;
    options.samples_per_ray = request.model->config().reconstruction.fit_samples_per_ray;
    options.mask = true;
    options.depth = true;
    options.remove_floaters = true;
    if (request.quality == Quality::thumbnail)
        options.resolution = std::min(thumbnail_side, request.model->config().decoder.resolution);
    return options;
}

/// A renderer with what it was made for.
struct Kept {
    std::shared_ptr<const Model> model;
    RendererOptions options;
    std::optional<FaceRenderer> renderer;

    [[nodiscard]] bool suits(const FrameRequest& request, const RendererOptions& wanted) const {
        return renderer && model == request.model && options.mode == wanted.mode &&
               options.resolution == wanted.resolution;
    }
    bool is_new = false;  ///< made for the last request
    FaceRenderer& for_request(const FrameRequest& request, const RendererOptions& wanted) {
        is_new = !suits(request, wanted);
        if (is_new) {
            renderer.emplace(*request.model, wanted);
            model = request.model;
            options = wanted;
        }
        renderer->set_tolerance(wanted.tolerance);
        renderer->show(request.codes);
        return *renderer;
    }
};

}  // namespace

void MovingSide::take(double milliseconds) {
    constexpr double memory = 0.8;  // weight of the earlier mean in the moving mean
    // Time of a frame at the whole side, in units of that at half the side.
    constexpr double whole_of_half = 4.0;
    // Half the side helps if its frames take less than this share of the time.
    constexpr double share_that_helps = 0.7;
    constexpr int frames_to_judge = 8;
    mean_ = frames_ == 0 ? milliseconds : memory * mean_ + (1.0 - memory) * milliseconds;
    ++frames_;
    slow_frames_ = milliseconds > most_ ? slow_frames_ + 1 : 0;
    if (frames_ < frames_to_judge) return;
    if (!is_half_) {
        if (half_helps_ && slow_frames_ >= frames_to_judge) {
            mean_of_whole_ = mean_;
            change_to(true);
        }
    } else if (mean_ > share_that_helps * mean_of_whole_) {
        half_helps_ = false;
        change_to(false);
    } else if (whole_of_half * mean_ < most_) {
        change_to(false);
    }
}

void MovingSide::change_to(bool half) {
    is_half_ = half;
    frames_ = 0;
    slow_frames_ = 0;
}

struct FrameRenderer::State {
    FrameSettings settings;
    double tolerance;  ///< of moving frames
    MovingSide side;
    Kept moving, still, thumbnail;

    [[nodiscard]] RendererOptions options_of_moving(const FrameRequest& request) const {
        RendererOptions options = options_for(request, settings.moving_mode, tolerance);
        if (is_half_side(request))
            options.resolution = request.model->config().decoder.resolution / 2;
        return options;
    }
    explicit State(const FrameSettings& given)
        : settings(given), tolerance(given.tolerance), side(given.most_moving_milliseconds) {}

    [[nodiscard]] bool is_half_side(const FrameRequest& request) const {
        const std::int64_t smallest = request.model->decoder().ladder().smallest();
        return side.is_half() && request.model->config().decoder.resolution / 2 >= smallest;
    }
    [[nodiscard]] Kept& kept(Quality quality) {
        if (quality == Quality::moving) return moving;
        return quality == Quality::thumbnail ? thumbnail : still;
    }
    /// Adapts the tolerance until the moving frame of this view has about the wanted PSNR, and no
    /// pixel is off by more than goes with it. Returns the PSNR, or nothing if stopped.
    [[nodiscard]] std::optional<double> adapt(const FrameRequest& request, const Tensor& exact,
                                              const std::stop_token& stop);
};

std::optional<double> FrameRenderer::State::adapt(const FrameRequest& request, const Tensor& exact,
                                                  const std::stop_token& stop) {
    if (options_for(request, settings.moving_mode, tolerance).mode == RenderMode::exact)
        return highest_psnr;
    const double step = std::sqrt(2.0);
    constexpr int most_steps = 4;
    std::optional<double> reached;
    for (int i = 0; i < most_steps; ++i) {
        const RendererOptions options = options_of_moving(request);
        const std::optional<View> view =
            moving.for_request(request, options).render(request.camera, stop);
        if (!view) return std::nullopt;
        const Tensor picture = picture_of(*view, request, exact.shape(0));
        FrameError error;
        error.add(enlarged(picture, exact.shape(0)), exact);
        reached = error.worst_psnr;
        if (is_half_side(request)) return reached;
        if (!error.within(settings.psnr) && tolerance > least_tolerance) {
            tolerance = std::max(tolerance / step, least_tolerance);
        } else {
            // The tolerance grows by only one step in a frame, so that it does not oscillate.
            if (i == 0 && error.within(settings.psnr + psnr_to_spare) &&
                tolerance < largest_tolerance)
                tolerance = std::min(tolerance * step, largest_tolerance);
            return reached;
        }
    }
    return reached;
}

FrameRenderer::FrameRenderer(const FrameSettings& settings)
    : state_(std::make_unique<State>(settings)) {}
FrameRenderer::~FrameRenderer() = default;
FrameRenderer::FrameRenderer(FrameRenderer&&) noexcept = default;

std::optional<Frame> FrameRenderer::render(const FrameRequest& request,
                                           const std::stop_token& stop) {
    State& state = *state_;
    const double start = seconds_now();
    const bool exact = request.quality == Quality::still || request.quality == Quality::snapshot;
    const bool moving = request.quality == Quality::moving;
    const RendererOptions options =
        moving ? state.options_of_moving(request)
               : options_for(request, exact ? RenderMode::exact : state.settings.moving_mode,
                             state.tolerance);
    const bool shows_field = request.layer == Layer::depth || request.layer == Layer::normals;
    const std::optional<View> view =
        state.kept(request.quality)
            .for_request(request, options)
            .render(request.camera, stop, shows_field ? FrameParts::field : FrameParts::all);
    if (!view) return std::nullopt;
    Frame frame;
    frame.side =
        options.resolution == 0 ? request.model->config().decoder.resolution : options.resolution;
    const Tensor picture = picture_of(*view, request, frame.side);
    frame.jpeg = jpeg_bytes(
        picture, exact ? state.settings.still_jpeg_quality : state.settings.moving_jpeg_quality);
    frame.milliseconds = 1e3 * (seconds_now() - start);
    // The first frame includes creating the renderer, which takes longer than a frame.
    if (moving && !state.moving.is_new) state.side.take(frame.milliseconds);
    frame.mode = name_of(options.mode);
    frame.tolerance = options.tolerance;
    if (request.quality == Quality::still && request.layer == Layer::image)
        frame.moving_psnr = state.adapt(request, picture, stop);
    return frame;
}

}  // namespace stymo::view
