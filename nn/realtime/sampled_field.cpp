// A view of the field by skipping: the field is evaluated only where it can be seen.
//
// A frame has one ray for each pixel of the feature map, with 64 samples by default, and all layers
// of the field would run at each of them. Only a few per cent of the samples have a weight that
// counts (docs/studies/left-out-work.md). The work is cut down in the order in which it would
// arise:
//
// First, a grid bounds the density at each sample, and `select_samples` (its file says why) picks
// the samples that are evaluated. A ray that is surely opaque may leave out stretches whose total
// weight is up to the tolerance. A ray that may end at the outline may not: its opacity decides
// whether the render blocks draw head or background, and they do so abruptly. Its stretches are
// limited by `strict`, which changes hardly anything in between.
//
// Second, a faint ray without a neighbour that is at least `solid` is empty. Thin haze fills the
// space around a head. The render blocks make it visible beside the head alone.
//
// Third, the samples are divided into tiles of whole rays. A tile evaluates the density, which is
// all that the weights need, and composites. The layer of the features runs only for samples whose
// weight, together with the small weights in front of it, is not negligible against the ray's
// opacity.
//
// Fourth, the last layer runs once for each ray, since it commutes with compositing, and not for
// chunks of rays that are all empty. The render blocks then skip what only empty rays reach.
//
// Mode `exact` is the same code with all samples selected and a tolerance of 0. What a frame of
// mode `skip` lacks is thus what was left out, not another arithmetic. docs/numerics.md has error
// and time of the modes.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <numeric>

#include "core/parallel.h"
#include "nn/engine/packed_field.h"
#include "nn/engine/ray_tile.h"
#include "nn/realtime/density_grid.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/field_source.h"

namespace stymo {
namespace {

constexpr std::int64_t rays_per_chunk = 32;
/// Largest total weight of a stretch that is left out on a ray whose opacity may be low.
constexpr float strict = 1e-3F;
/// Between the two limits, the limit of a ray is the tolerance times this power of the opacity that
/// the ray surely has.
constexpr int opacity_power = 20;
/// Estimated opacity from which on a ray, and its neighbours, are not empty.
constexpr float solid = 0.1F;
/// In units of the tolerance and of the ray's opacity: largest total weight of a ray's samples
/// whose features are not computed.
constexpr float featureless_share = 0.4F;
/// Cells of the density grid between the planes that bound the samples.
constexpr double cells_in_depth = 32.0;

/// Buffers of one thread.
struct Scratch {
    RayTile<float> tile;
    std::vector<float> points;           ///< of one ray
    std::vector<std::int32_t> rows;      ///< rows of the tile whose features are computed
    std::vector<std::int32_t> row_rays;  ///< their rays
    std::vector<float> row_weights;
    std::vector<DensityBounds> bounds;
    std::int64_t significant = 0;  ///< samples with a weight above significant_weight
};

void append_point(const Ray& ray, double distance, std::vector<float>& points) {
    for (std::size_t axis = 0; axis < 3; ++axis)
        points.push_back(static_cast<float>(ray.origin[axis] + distance * ray.direction[axis]));
}

void append_points(const Ray& ray, const SampleRange& range, std::int64_t samples,
                   std::vector<float>& points) {
    for (std::int32_t k = range.first; k < range.end; ++k)
        append_point(ray, sample_distance(ray, k, samples), points);
}

/// The samples of a camera's rays, at the positions and with the intervals of `sample_rays`.
struct CameraSamples {
    const CameraRays& rays;

    [[nodiscard]] double distance(std::int64_t ray, std::int32_t sample) const {
        return sample_distance(rays.rays[static_cast<std::size_t>(ray)], sample,
                               rays.samples_per_ray);
    }
    void append(std::int64_t ray, std::int32_t sample, std::vector<float>& points) const {
        append_point(rays.rays[static_cast<std::size_t>(ray)], distance(ray, sample), points);
    }
    [[nodiscard]] float length(std::int64_t ray, std::int32_t sample) const {
        return static_cast<float>(distance(ray, sample + 1) - distance(ray, sample));
    }
};

float interval(const Ray& ray, std::int64_t samples) {
    return static_cast<float>((ray.far_distance - ray.near_distance) /
                              static_cast<double>(samples));
}

/// A grid around the volume that the model's camera sees as the head turns, with some room for
/// other distances.
DensityGrid make_grid(const ModelConfig& model) {
    const RaySampling& sampling = model.decoder.rays;
    const double reach = std::max(std::abs(sampling.near_z), std::abs(sampling.far_z));
    const double side = 0.5 / model.camera.intrinsics.focal * (model.camera.distance + reach);
    constexpr double room = 1.25;
    const double half_side = room * std::hypot(reach, side, side);
    // The cells of unusual cameras are larger, so that the grid never needs more than 70 MB.
    constexpr double most_cells = 256.0;
    return {half_side, std::max((sampling.near_z - sampling.far_z) / cells_in_depth,
                                2.0 * half_side / most_cells)};
}

class SampledField final : public FieldSource {
public:
    SampledField(const ModelConfig& model, const RendererOptions& options);

    void set_field(const FoldedField& field) override;
    void set_tolerance(double tolerance) override {
        if (tolerates_) tolerance_ = static_cast<float>(tolerance);
    }
    void render(const CameraRays& rays, FeatureMap& map, const std::stop_token& stop) override;

private:
    void evaluate_grid_around(std::span<const float> points);
    void select(const CameraRays& rays);
    [[nodiscard]] bool select_from_grid(const CameraRays& rays);
    [[nodiscard]] float limit_of_ray(float surely_opaque) const;
    void empty_haze();
    void cut_into_tiles();
    void reserve();
    void trace_tile(std::int64_t first, std::int64_t end, const CameraRays& rays, Scratch& scratch,
                    FeatureMap& map);
    void finish_ray(std::int64_t ray, const CameraSamples& samples, Scratch& scratch,
                    FeatureMap& map);
    void finish(FeatureMap& map);

    bool tolerates_;
    float tolerance_;
    PackedField<float> field_;
    DensityGrid grid_;
    SampleSelection selection_;
    std::vector<float> estimates_;     ///< of the opacity of each ray
    std::vector<std::int64_t> tiles_;  ///< first ray of each, and the end of the last
    std::int64_t largest_tile_ = 0;    ///< points
    std::vector<Scratch> scratch_;     ///< of each thread
    std::vector<float> composited_;    ///< (rays, width)
    float background_ = 0.0F;
};

SampledField::SampledField(const ModelConfig& model, const RendererOptions& options)
    : tolerates_(stymo::tolerates(options.mode)),
      tolerance_(tolerates_ ? static_cast<float>(options.tolerance) : 0.0F) {
    if (tolerates_) grid_ = make_grid(model);
}

void SampledField::set_field(const FoldedField& field) {
    field_ = PackedField<float>(field);
    if (tolerates_) grid_.forget();
}

void SampledField::evaluate_grid_around(std::span<const float> points) {
    grid_.evaluate_around(points, [this](std::span<const float> vertices, std::span<float> logits) {
        const auto position_of = [&](std::int64_t i) {
            return vertices.subspan(static_cast<std::size_t>(3 * i), 3);
        };
        evaluate_points(field_, std::ssize(logits), position_of,
                        [&](std::int64_t first, std::int64_t size, const FieldTile<float>& tile) {
                            std::copy_n(tile.logits.begin(), size, logits.begin() + first);
                        });
    });
}

void SampledField::render(const CameraRays& rays, FeatureMap& map, const std::stop_token& stop) {
    const std::size_t count = rays.rays.size();
    scratch_.resize(static_cast<std::size_t>(thread_count()));
    for (Scratch& scratch : scratch_) {
        scratch.significant = 0;
        scratch.points.reserve(static_cast<std::size_t>(3 * rays.samples_per_ray));
        scratch.bounds.reserve(static_cast<std::size_t>(rays.samples_per_ray));
    }
    composited_.resize(count * static_cast<std::size_t>(field_.width()));
    map.opacities.resize(count);
    map.features.resize(count * static_cast<std::size_t>(field_.feature_channels()));
    map.occupied.resize(count);
    map.depths.resize(count);
    background_ = static_cast<float>(farthest_sample(rays));

    const std::int64_t known_vertices = grid_.known_vertices();
    select(rays);
    cut_into_tiles();
    reserve();
    const auto trace = [&](std::int64_t tile, int thread) {
        if (stop.stop_requested()) return;
        const auto index = static_cast<std::size_t>(tile);
        trace_tile(tiles_[index], tiles_[index + 1], rays,
                   scratch_[static_cast<std::size_t>(thread)], map);
    };
    // Passed by reference, since std::function would allocate memory for a closure of this size.
    parallel_items(std::ssize(tiles_) - 1, std::ref(trace));
    if (stop.stop_requested()) return;
    finish(map);
    map.grid_points = grid_.known_vertices() - known_vertices;
    map.field_samples = map.significant_samples = 0;
    for (const std::int32_t selected : selection_.counts) map.field_samples += selected;
    for (const Scratch& scratch : scratch_) map.significant_samples += scratch.significant;
    map.tiles = map.field_samples > 0 ? std::ssize(tiles_) - 1 : 0;
}

void SampledField::select(const CameraRays& rays) {
    const std::size_t count = rays.rays.size();
    selection_.resize(static_cast<std::int64_t>(count), rays.samples_per_ray);
    if (!tolerates_) {
        for (std::size_t i = 0; i < count; ++i)
            selection_.keep_range(static_cast<std::int64_t>(i), rays.known[i].first,
                                  rays.known[i].end);
        return;
    }
    estimates_.resize(count);
    if (!select_from_grid(rays)) {
        std::vector<float>& points = scratch_.front().points;
        points.clear();
        for (std::size_t i = 0; i < count; ++i)
            append_points(rays.rays[i], rays.known[i], rays.samples_per_ray, points);
        evaluate_grid_around(points);
        static_cast<void>(select_from_grid(rays));
    }
    empty_haze();
}

/// Largest total weight of a stretch of samples that may be left out.
float SampledField::limit_of_ray(float surely_opaque) const {
    return std::max(std::min(strict, tolerance_),
                    tolerance_ * std::pow(surely_opaque, static_cast<float>(opacity_power)));
}

/// False if the grid does not know enough yet.
bool SampledField::select_from_grid(const CameraRays& rays) {
    const auto count = static_cast<std::int64_t>(rays.rays.size()), samples = rays.samples_per_ray;
    std::atomic<bool> known{true};
    const auto select_chunk = [&](std::int64_t chunk, int thread) {
        Scratch& scratch = scratch_[static_cast<std::size_t>(thread)];
        for (std::int64_t i = chunk * rays_per_chunk;
             i < std::min(count, (chunk + 1) * rays_per_chunk); ++i) {
            const Ray& ray = rays.rays[static_cast<std::size_t>(i)];
            const SampleRange range = rays.known[static_cast<std::size_t>(i)];
            const float delta = interval(ray, samples);
            scratch.points.clear();
            append_points(ray, range, samples, scratch.points);
            scratch.bounds.resize(static_cast<std::size_t>(range.end - range.first));
            if (!grid_.bounds(scratch.points, scratch.bounds)) known = false;
            float estimate = 0.0F, least = 0.0F;
            for (const DensityBounds& at_sample : scratch.bounds) {
                estimate += at_sample.estimate * delta;
                least += at_sample.lower * delta;
            }
            estimates_[static_cast<std::size_t>(i)] = -std::expm1(-estimate);
            select_samples(scratch.bounds, range.first, delta, limit_of_ray(-std::expm1(-least)), i,
                           selection_);
        }
    };
    parallel_items(chunk_count(count, rays_per_chunk), std::ref(select_chunk));
    return known;
}

/// Empties faint rays without a neighbour, also diagonal, that is solid.
void SampledField::empty_haze() {
    const auto side =
        static_cast<std::int64_t>(std::llround(std::sqrt(static_cast<double>(estimates_.size()))));
    const float least = std::min(solid, tolerance_);
    const auto is_solid = [&](std::int64_t row, std::int64_t column) {
        return row >= 0 && row < side && column >= 0 && column < side &&
               estimates_[static_cast<std::size_t>(row * side + column)] >= least;
    };
    for (std::int64_t row = 0; row < side; ++row) {
        for (std::int64_t column = 0; column < side; ++column) {
            bool shows = false;
            for (std::int64_t i = 0; i < 9 && !shows; ++i)
                shows = is_solid(row + i / 3 - 1, column + i % 3 - 1);
            if (!shows) selection_.keep_range(row * side + column, 0, 0);
        }
    }
}

/// Divides the samples into tiles of whole rays, so that each tile can composite its rays. Tiles
/// have about the same size, and their number is a multiple of the number of threads.
void SampledField::cut_into_tiles() {
    const std::int64_t all =
        std::accumulate(selection_.counts.begin(), selection_.counts.end(), std::int64_t{0});
    const std::int64_t rounds = chunk_count(all, tile_points * thread_count()),
                       tiles = std::max<std::int64_t>(rounds, 1) * thread_count();
    tiles_.assign(1, 0);
    std::int64_t points = 0, done = 0;
    largest_tile_ = 0;
    for (std::size_t ray = 0; ray < selection_.counts.size(); ++ray) {
        if (points > 0 && (done + selection_.counts[ray] / 2) * tiles >= std::ssize(tiles_) * all) {
            tiles_.push_back(static_cast<std::int64_t>(ray));
            points = 0;
        }
        points += selection_.counts[ray];
        done += selection_.counts[ray];
        largest_tile_ = std::max(largest_tile_, points);
    }
    tiles_.push_back(static_cast<std::int64_t>(selection_.counts.size()));
}

/// For every thread, because any of them may get the largest tile.
void SampledField::reserve() {
    const auto points = static_cast<std::size_t>(largest_tile_);
    for (Scratch& scratch : scratch_) {
        field_.reserve(largest_tile_, scratch.tile.field);
        scratch.tile.reserve(largest_tile_, std::ssize(selection_.counts));
        scratch.rows.reserve(points);
        scratch.row_rays.reserve(points);
        scratch.row_weights.reserve(points);
    }
}

void SampledField::trace_tile(std::int64_t first, std::int64_t end, const CameraRays& rays,
                              Scratch& scratch, FeatureMap& map) {
    const CameraSamples samples{rays};
    RayTile<float>& tile = scratch.tile;
    tile.take(selection_, samples, first, end);
    field_.evaluate(tile.points, tile.field);
    tile.composite(selection_, samples);

    scratch.rows.clear();
    scratch.row_rays.clear();
    scratch.row_weights.clear();
    for (std::int64_t ray = first; ray < end; ++ray) finish_ray(ray, samples, scratch, map);
    field_.features(scratch.rows, tile.field);

    const std::int64_t width = field_.width();
    std::fill(composited_.begin() + first * width, composited_.begin() + end * width, 0.0F);
    for (std::size_t i = 0; i < scratch.rows.size(); ++i)
        add_weighted(composited_.data() + scratch.row_rays[i] * width, scratch.row_weights[i],
                     tile.field.features.data() + static_cast<std::int64_t>(i) * width, width);
}

/// Opacity and depth of one ray from its weights, and the rows of the tile whose features are
/// computed.
void SampledField::finish_ray(std::int64_t ray, const CameraSamples& samples, Scratch& scratch,
                              FeatureMap& map) {
    const auto index = static_cast<std::size_t>(ray);
    const std::span<const std::int32_t> selected = selection_.samples_of(ray);
    const std::int64_t first_row = scratch.tile.begin_of(ray);
    const std::span<const float> weights =
        std::span(scratch.tile.weights)
            .subspan(static_cast<std::size_t>(first_row), selected.size());
    float opacity = 0.0F, depth = 0.0F;
    for (std::size_t k = 0; k < weights.size(); ++k) {
        opacity += weights[k];
        depth += weights[k] * static_cast<float>(samples.distance(ray, selected[k]));
        if (static_cast<double>(weights[k]) > significant_weight) ++scratch.significant;
    }
    map.opacities[index] = opacity;
    map.depths[index] = depth + (1.0F - opacity) * background_;

    // One that is not a number is occupied, so that the frame is found not to be finite.
    map.occupied[index] = opacity <= 0.0F ? 0 : 1;
    if (opacity <= 0.0F) return;
    // A weight that is too small is added to the next sample whose features are computed.
    const float least =
        featureless_share * tolerance_ * opacity / static_cast<float>(weights.size());
    float carried = 0.0F;
    for (std::size_t k = 0; k < weights.size(); ++k) {
        carried += weights[k];
        if (carried < least) continue;
        scratch.rows.push_back(static_cast<std::int32_t>(first_row) + static_cast<std::int32_t>(k));
        scratch.row_rays.push_back(static_cast<std::int32_t>(ray));
        scratch.row_weights.push_back(carried);
        carried = 0.0F;
    }
    scratch.row_weights.back() += carried;
}

void SampledField::finish(FeatureMap& map) {
    const auto count = static_cast<std::int64_t>(map.occupied.size()), width = field_.width(),
               channels = field_.feature_channels();
    const auto finish_rays = [&](std::int64_t first, std::int64_t end) {
        const std::int64_t size = end - first;
        const auto part = [&](auto& values, std::int64_t numbers) {
            return std::span(values).subspan(static_cast<std::size_t>(first * numbers),
                                             static_cast<std::size_t>(size * numbers));
        };
        const auto result = part(map.features, channels);
        if (std::ranges::any_of(part(map.occupied, 1),
                                [](std::uint8_t occupied) { return occupied != 0; })) {
            field_.apply_last_layer(part(composited_, width), part(map.opacities, 1), result);
        } else {
            std::ranges::fill(result, 0.0F);
        }
    };
    parallel_for(count, rays_per_chunk, std::ref(finish_rays));
}

}  // namespace

double farthest_sample(const CameraRays& rays) {
    double farthest = 0.0;
    for (const Ray& ray : rays.rays)
        farthest = std::max(farthest,
                            sample_distance(ray, rays.samples_per_ray - 1, rays.samples_per_ray));
    return farthest;
}

std::unique_ptr<FieldSource> make_sampled_field(const ModelConfig& model,
                                                const RendererOptions& options) {
    return std::make_unique<SampledField>(model, options);
}

}  // namespace stymo
