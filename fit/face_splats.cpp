#include "fit/face_splats.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "core/tensor_eigen.h"
#include "fit/laid_head.h"
#include "nn/optim/adam.h"
#include "render/depth_map.h"

namespace stymo {

namespace {

using Position = Eigen::Vector2d;
using Vector = Eigen::Vector3d;

/// A point of the surface, as the view has it that sees it most nearly straight.
struct Sample {
    Vector point = Vector::Zero(), normal = Vector::Zero();
    double cosine = 0.0;  ///< between normal and line of sight
    double size = 0.0;    ///< distance to the next samples, world units
    Eigen::Vector3f color = Eigen::Vector3f::Zero();
};

std::optional<Sample> sample_at(const SeenFace& view, const Position& position, double spacing) {
    constexpr double least_cosine = 0.1;
    const double step = 1.0 / static_cast<double>(view.depth.shape(0));
    const auto point = [&](double right, double down) {
        return point_at(view.camera, view.depth, position + step * Position(right, down));
    };
    const Vector across = point(1, 0) - point(-1, 0), down = point(0, 1) - point(0, -1);
    Sample sample{.point = point(0, 0), .normal = down.cross(across).normalized()};
    const Vector back = view.camera.center - sample.point;
    sample.cosine = back.normalized().dot(sample.normal);
    if (!sample.point.allFinite() || !(sample.cosine > least_cosine)) return std::nullopt;
    sample.size = spacing * back.norm() / view.camera.intrinsics.focal;
    sample.color =
        texel(view.image, static_cast<float>(position[0]), static_cast<float>(position[1]))
            .head<3>()
            .matrix();
    return sample;
}

/// Whether no other view sees the sample much straighter, and the views' masks have it.
bool belongs(const Sample& sample, std::size_t own, std::span<const SeenFace> views) {
    constexpr double same_depth = 0.03;       // world units
    constexpr double much_straighter = 0.06;  // so that samples of neighbouring views overlap
    constexpr double most_outside = 0.5;
    double outside = 0.0;
    for (std::size_t k = 0; k < views.size(); ++k) {
        const SeenFace& view = views[k];
        const Position position = project(view.camera, sample.point).head<2>();
        outside += texel(view.mask, static_cast<float>(position[0]),
                         static_cast<float>(position[1]))[0] < 0.5F
                       ? 1.0
                       : 0.0;
        if (k == own || position.minCoeff() <= 0.0 || position.maxCoeff() >= 1.0) continue;
        const Vector back = view.camera.center - sample.point;
        const bool seen = std::abs(depth_at(view.depth, position) - back.norm()) < same_depth;
        if (seen && back.normalized().dot(sample.normal) > sample.cosine + much_straighter)
            return false;
    }
    return outside <= most_outside * static_cast<double>(views.size());
}

/// Samples on grids of this spacing, in units of an image's side.
std::vector<Sample> surface_samples(std::span<const SeenFace> views, double spacing) {
    std::vector<std::vector<Sample>> of_view(views.size());
    const auto steps = static_cast<std::int64_t>(1.0 / spacing);
    parallel_items(std::ssize(views), [&](std::int64_t item, int) {
        const auto k = static_cast<std::size_t>(item);
        for (std::int64_t i = 0; i < steps * steps; ++i) {
            const Position position =
                spacing * Position(double(i % steps) + 0.5, double(i / steps) + 0.5);
            const std::optional<Sample> sample = sample_at(views[k], position, spacing);
            if (sample && belongs(*sample, k, views)) of_view[k].push_back(*sample);
        }
    });
    std::vector<Sample> all;
    for (const std::vector<Sample>& samples : of_view)
        all.insert(all.end(), samples.begin(), samples.end());
    return all;
}

Splats begun_splats(std::span<const Sample> samples) {
    const auto count = std::ssize(samples);
    constexpr double begun_logit = 2.2, overlap = 0.6, constant = 0.28209479;
    Splats splats{Tensor({count, 3}), Tensor({count, 3}), Tensor({count, 1}),
                  Tensor::full({count, 1}, begun_logit), Tensor::zeros({count, 12})};
    auto centers = mutable_matrix_map<float>(splats.centers);
    auto normals = mutable_matrix_map<float>(splats.normals);
    auto sizes = mutable_matrix_map<float>(splats.sizes);
    auto colors = mutable_matrix_map<float>(splats.colors);
    for (Eigen::Index i = 0; i < count; ++i) {
        const Sample& sample = samples[static_cast<std::size_t>(i)];
        centers.row(i) = sample.point.transpose().cast<float>();
        normals.row(i) = sample.normal.transpose().cast<float>();
        sizes(i, 0) = static_cast<float>(
            std::log(overlap * sample.size / std::sqrt(std::max(sample.cosine, 0.3))));
        colors.row(i).head<3>() =
            (sample.color.array() - 0.5F).matrix().transpose() / static_cast<float>(constant);
    }
    return splats;
}

/// The sum of the losses of some views. Its order is that of the views.
Splats gradient_of(const Splats& splats, std::span<const TextureView> views) {
    std::vector<Splats> parts(views.size());
    parallel_items(std::ssize(views), [&](std::int64_t view, int) {
        const auto k = static_cast<std::size_t>(view);
        parts[k] = splat_loss(splats, views[k]).gradient;
    });
    for (std::size_t k = 1; k < parts.size(); ++k)
        for (Tensor Splats::*part :
             {&Splats::centers, &Splats::sizes, &Splats::logits, &Splats::colors})
            mutable_matrix_map<float>(parts.front().*part) += matrix_map<float>(parts[k].*part);
    return parts.front();
}

}  // namespace

Splats face_splats(const Model& model, const Codes& codes, std::int64_t count,
                   const std::function<void(double)>& observe) {
    if (count < 1) fail<ValueError>("a face cannot be made of ", count, " splats; give 1 or more");
    constexpr double largest_yaw = 0.785;
    constexpr int yaws = 8;
    // About, of the whole time.
    constexpr double share_of_views = 0.4;
    const auto seen = surface_views(model, codes, largest_yaw, yaws, true, [&](double done) {
        if (observe) observe(share_of_views * done);
    });
    constexpr double coarse = 1.0 / 64.0;
    const auto found = static_cast<double>(surface_samples(seen, coarse).size());
    if (found == 0.0) fail<ValueError>("nothing of this face is inside its head mask");
    const double spacing = std::min(coarse * std::sqrt(found / static_cast<double>(count)), 1.0);
    const std::vector<Sample> samples = surface_samples(seen, spacing);
    if (samples.empty())
        fail<ValueError>("a grid of ", count, " splats misses this face; give more");
    Splats splats = begun_splats(samples);

    std::vector<TextureView> views;
    for (const SeenFace& view : seen) views.push_back({view.camera, view.image, view.mask});
    constexpr std::size_t at_once = 4, stride = 7, steps = 100;
    Adam adam({.beta2 = 0.99});
    ParameterStore store;
    struct Fitted {
        Tensor Splats::*part;
        double rate;
        Parameter parameter;
    };
    std::array fitted{Fitted{&Splats::centers, 0.002, store.create("centers", splats.centers)},
                      Fitted{&Splats::sizes, 0.02, store.create("sizes", splats.sizes)},
                      Fitted{&Splats::logits, 0.1, store.create("logits", splats.logits)},
                      Fitted{&Splats::colors, 0.05, store.create("colors", splats.colors)}};
    for (std::size_t step = 0; step < steps; ++step) {
        std::vector<TextureView> some;
        for (std::size_t k = at_once * step; k < at_once * (step + 1); ++k)
            some.push_back(views[stride * k % views.size()]);
        const Splats gradient = gradient_of(splats, some);
        const double slower = std::pow(0.1, static_cast<double>(step) / steps);
        for (const Fitted& each : fitted) {
            const Variable slope(gradient.*each.part);
            adam.step({&each.parameter, 1}, {&slope, 1}, slower * each.rate);
            splats.*each.part = each.parameter.variable().value();
        }
        if (observe) observe(std::lerp(share_of_views, 1.0, static_cast<double>(step + 1) / steps));
    }
    return splats;
}

}  // namespace stymo
