#include "render/splats.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/tensor_eigen.h"

namespace stymo {

namespace {

constexpr float filter_variance = 0.3F, nearest = 0.2F;
constexpr float least_alpha = 1.0F / 255.0F, most_alpha = 0.99F;
/// Where less light is left, nothing more is drawn.
constexpr float least_light = 1e-3F;
constexpr float mask_weight = 0.3F;

/// A splat in an image, lengths in pixels.
struct Drawn {
    std::int64_t index = 0;
    float depth = 0.0F;
    Eigen::Vector2f position = Eigen::Vector2f::Zero();
    Eigen::Matrix<float, 2, 3> position_by_center = Eigen::Matrix<float, 2, 3>::Zero();
    float variance = 0.0F, opacity = 0.0F;
    Eigen::Matrix2f shape = Eigen::Matrix2f::Zero();  ///< covariance before the filter / variance
    Eigen::Matrix2f precision = Eigen::Matrix2f::Zero();
    Eigen::Array4f harmonics = Eigen::Array4f::Zero(), color = Eigen::Array4f::Ones();
    std::int64_t left = 0, right = 0, top = 0, bottom = 0;  ///< pixels, both ends included
};

/// What a splat adds to a pixel.
struct Touch {
    std::int32_t pixel;
    float alpha, light;  ///< light: the share that passes what is in front
};

struct Frame {
    std::vector<Drawn> splats;           ///< front to back
    std::vector<std::size_t> first;      ///< touch of each splat, and the end
    std::vector<Touch> touches;          ///< in the order of the splats
    std::vector<Eigen::Array4f> pixels;  ///< colours, coverage
};

std::optional<Drawn> projected(const Splats& splats, std::int64_t index, const Camera& camera,
                               std::int64_t side) {
    Drawn drawn{.index = index};
    const auto extent = static_cast<float>(side);
    const Eigen::Vector3f sight =
        matrix_map<float>(splats.centers).row(index).transpose() - camera.center.cast<float>();
    const Eigen::Matrix3f camera_from_world = camera.world_from_camera.transpose().cast<float>();
    const Eigen::Vector3f seen = camera_from_world * sight;
    drawn.depth = seen[2];
    drawn.opacity = 1.0F / (1.0F + std::exp(-matrix_map<float>(splats.logits)(index, 0)));
    if (!(drawn.depth > nearest) || !(drawn.opacity > least_alpha)) return std::nullopt;
    const auto scale = static_cast<float>(camera.intrinsics.focal) * extent / drawn.depth;
    drawn.position =
        scale * seen.head<2>() +
        extent *
            Eigen::Vector2d(camera.intrinsics.center_x, camera.intrinsics.center_y).cast<float>();
    Eigen::Matrix<float, 2, 3> by_axes;
    by_axes << scale, 0.0F, -scale * seen[0] / drawn.depth,  //
        0.0F, scale, -scale * seen[1] / drawn.depth;
    drawn.position_by_center = by_axes * camera_from_world;
    const Eigen::Vector2f along =
        drawn.position_by_center * matrix_map<float>(splats.normals).row(index).transpose();
    drawn.shape = drawn.position_by_center * drawn.position_by_center.transpose() -
                  (1.0F - splat_thickness * splat_thickness) * along * along.transpose();
    drawn.variance = std::exp(2.0F * matrix_map<float>(splats.sizes)(index, 0));
    const Eigen::Matrix2f covariance =
        drawn.variance * drawn.shape + filter_variance * Eigen::Matrix2f::Identity();
    drawn.precision = covariance.inverse();
    const Eigen::Array2f reach = std::sqrt(2.0F * std::log(drawn.opacity / least_alpha)) *
                                 covariance.diagonal().array().sqrt();
    const auto first = [](float from) { return static_cast<std::int64_t>(std::ceil(from - 0.5F)); };
    const Eigen::Array2f from = (drawn.position.array() - reach).max(0.0F).min(extent + 1.0F);
    const Eigen::Array2f to = (drawn.position.array() + reach).max(-1.0F).min(extent);
    drawn.left = first(from[0]), drawn.right = first(to[0]) - 1;
    drawn.top = first(from[1]), drawn.bottom = first(to[1]) - 1;
    if (drawn.left > drawn.right || drawn.top > drawn.bottom) return std::nullopt;
    constexpr float constant = 0.28209479F, linear = 0.48860251F;
    const Eigen::Vector3f direction = sight.normalized();
    drawn.harmonics << constant, -linear * direction[1], linear * direction[2],
        -linear * direction[0];
    for (Eigen::Index channel = 0; channel < 3; ++channel) {
        drawn.color[channel] = 0.5F;
        for (Eigen::Index k = 0; k < 4; ++k)
            drawn.color[channel] +=
                drawn.harmonics[k] * matrix_map<float>(splats.colors)(index, 3 * k + channel);
    }
    return drawn;
}

void composite(const Drawn& splat, std::int64_t side, std::vector<float>& light, Frame& frame) {
    const Eigen::Array4f color = splat.color.max(0.0F);
    for (std::int64_t row = splat.top; row <= splat.bottom; ++row)
        for (std::int64_t column = splat.left; column <= splat.right; ++column) {
            const auto pixel = static_cast<std::size_t>(row * side + column);
            if (light[pixel] < least_light) continue;
            const Eigen::Vector2f away(static_cast<float>(column) + 0.5F - splat.position[0],
                                       static_cast<float>(row) + 0.5F - splat.position[1]);
            const float alpha = std::min(
                splat.opacity * std::exp(-0.5F * away.dot(splat.precision * away)), most_alpha);
            if (alpha < least_alpha) continue;
            frame.pixels[pixel] += alpha * light[pixel] * color;
            frame.touches.push_back({static_cast<std::int32_t>(pixel), alpha, light[pixel]});
            light[pixel] *= 1.0F - alpha;
        }
}

Frame drawn_frame(const Splats& splats, const Camera& camera, std::int64_t side) {
    Frame frame;
    for (std::int64_t i = 0; i < splats.centers.shape(0); ++i)
        if (const std::optional<Drawn> drawn = projected(splats, i, camera, side))
            frame.splats.push_back(*drawn);
    std::ranges::stable_sort(frame.splats, {}, &Drawn::depth);
    frame.pixels.assign(static_cast<std::size_t>(side * side), Eigen::Array4f::Zero());
    std::vector<float> light(frame.pixels.size(), 1.0F);
    for (const Drawn& splat : frame.splats) {
        frame.first.push_back(frame.touches.size());
        composite(splat, side, light, frame);
    }
    frame.first.push_back(frame.touches.size());
    return frame;
}

/// The gradient with respect to the splats from that with respect to the pixels.
Splats gradient_of(const Frame& frame, const std::vector<Eigen::Array4f>& slopes,
                   const Splats& splats, std::int64_t side) {
    Splats gradient{Tensor::zeros(splats.centers.shape()),
                    {},
                    Tensor::zeros(splats.sizes.shape()),
                    Tensor::zeros(splats.logits.shape()),
                    Tensor::zeros(splats.colors.shape())};
    auto centers = mutable_matrix_map<float>(gradient.centers);
    auto sizes = mutable_matrix_map<float>(gradient.sizes);
    auto logits = mutable_matrix_map<float>(gradient.logits);
    auto colors = mutable_matrix_map<float>(gradient.colors);
    std::vector<Eigen::Array4f> behind(slopes.size(), Eigen::Array4f::Zero());
    for (std::size_t k = frame.splats.size(); k-- > 0;) {
        const Drawn& splat = frame.splats[k];
        const Eigen::Array4f color = splat.color.max(0.0F);
        Eigen::Array4f by_color = Eigen::Array4f::Zero();
        float by_exponent = 0.0F;
        Eigen::Vector2f pull = Eigen::Vector2f::Zero();
        Eigen::Matrix2f scatter = Eigen::Matrix2f::Zero();
        for (std::size_t touch = frame.first[k + 1]; touch-- > frame.first[k];) {
            const auto& [index, alpha, light] = frame.touches[touch];
            const auto pixel = static_cast<std::size_t>(index);
            by_color += alpha * light * slopes[pixel];
            const float by_alpha = light * (slopes[pixel] * (color - behind[pixel])).sum();
            behind[pixel] += alpha * (color - behind[pixel]);
            if (alpha >= most_alpha) continue;
            const Eigen::Vector2f away(static_cast<float>(index % side) + 0.5F - splat.position[0],
                                       static_cast<float>(index / side) + 0.5F - splat.position[1]);
            const float weight = by_alpha * alpha;
            by_exponent += weight;
            pull += weight * away;
            scatter += weight * away * away.transpose();
        }
        const auto row = static_cast<Eigen::Index>(splat.index);
        const Eigen::Vector2f by_position = splat.precision * pull;
        for (Eigen::Index axis = 0; axis < 3; ++axis)
            centers(row, axis) = splat.position_by_center.col(axis).dot(by_position);
        sizes(row, 0) =
            splat.variance *
            (splat.precision * scatter * splat.precision).cwiseProduct(splat.shape).sum();
        logits(row, 0) = by_exponent * (1.0F - splat.opacity);
        for (Eigen::Index i = 0; i < 12; ++i)
            if (splat.color[i % 3] > 0.0F)
                colors(row, i) = splat.harmonics[i / 3] * by_color[i % 3];
    }
    return gradient;
}

}  // namespace

RasterImage rendered_splats(const Splats& splats, const Camera& camera, std::int64_t side) {
    const Frame frame = drawn_frame(splats, camera, side);
    RasterImage image;
    image.color = Tensor({side, side, 3});
    image.coverage = Tensor({side, side, 1});
    auto colors = mutable_matrix_map<float>(image.color);
    auto coverage = mutable_matrix_map<float>(image.coverage);
    for (std::size_t i = 0; i < frame.pixels.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        colors.row(row) = frame.pixels[i].head<3>().min(1.0F).matrix();
        coverage(row, 0) = frame.pixels[i][3];
    }
    return image;
}

SplatLoss splat_loss(const Splats& splats, const TextureView& view) {
    const std::int64_t side = view.image.shape(0);
    const Frame frame = drawn_frame(splats, view.camera, side);
    std::vector<Eigen::Array4f> slopes(frame.pixels.size());
    SplatLoss loss;
    for (std::size_t i = 0; i < slopes.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const float mask = matrix_map<float>(view.mask)(row, 0);
        Eigen::Array4f difference = frame.pixels[i];
        difference.head<3>() -= mask * matrix_map<float>(view.image).row(row).transpose().array();
        difference[3] -= mask;
        slopes[i] = 2.0F * difference * Eigen::Array4f(1.0F, 1.0F, 1.0F, mask_weight);
        loss.value += double{0.5F * (slopes[i] * difference).sum()};
    }
    loss.gradient = gradient_of(frame, slopes, splats, side);
    return loss;
}

}  // namespace stymo
