#include "nn/realtime/face_renderer.h"

#include <algorithm>
#include <array>

#include "core/error.h"
#include "nn/engine/block_renderer.h"
#include "nn/models/display_image.h"
#include "nn/realtime/field_source.h"

namespace stymo {
namespace {

void require_tolerance(double tolerance) {
    if (!(tolerance >= 0.0 && tolerance < 1.0))
        fail<ValueError>("the tolerance must be from 0 to below 1, got ", tolerance);
}

void require_valid(const Model& model, const RendererOptions& options) {
    if (options.samples_per_ray < 2)
        fail<ValueError>("a ray needs at least 2 samples, got ", options.samples_per_ray);
    require_tolerance(options.tolerance);
    const DecoderConfig& decoder = model.config().decoder;
    if (options.mode != RenderMode::exact && !model.decoder().folds())
        fail<ValueError>("a model with decoder.conditioning = ", decoder.conditioning,
                         " is rendered in mode exact alone; the others need modulation");
    static_cast<void>(model.decoder().ladder().count_up_to(options.resolution));  // throws
}

/// Null for a model whose layers do not fold.
std::unique_ptr<FieldSource> make_field_source(const ModelConfig& model,
                                               const RendererOptions& options) {
    if (model.decoder.conditioning != "modulation") return nullptr;
    return make_sampled_field(model, options);
}

/// Number of layers that a frame needs.
struct LayerCount {
    std::int64_t field = 0;
    std::int64_t image = 0;  ///< render blocks and mask branch
};

LayerCount layer_count(const Decoder& decoder, std::int64_t resolution, bool mask) {
    constexpr std::int64_t of_block = 4,
                           beside_sine_layers = 3;  // FoldedRenderBlock; density and features
    LayerCount count{decoder.config().field_layers + beside_sine_layers, mask ? 1 : 0};
    const auto blocks = static_cast<std::int64_t>(decoder.ladder().count_up_to(resolution));
    count.image += blocks * (of_block + (mask ? 1 : 0));
    return count;
}

}  // namespace

struct FaceRenderer::State {
    const Model& model;
    RendererOptions options;
    std::unique_ptr<FieldSource> field;
    std::array<std::vector<float>, code_names.size()> shown;  ///< codes in Z
    Codes z;
    Codes w;
    RaySampling sampling;
    CameraRays rays;
    std::optional<Camera> camera;  ///< camera of the feature map that is kept
    FeatureMap feature_map;
    FloaterRemoval floaters;
    bool feature_map_is_new = true;  ///< since the last call of BlockRenderer::set_feature_map
    std::optional<BlockRenderer> blocks;
    View view;  ///< buffers of the last frame, which the next one reuses unless a copy of the View
                ///< still exists
    RenderCounts counts;

    State(const Model& shown_model, const RendererOptions& renderer_options)
        : model(shown_model),
          options(renderer_options),
          field(make_field_source(shown_model.config(), renderer_options)),
          sampling(shown_model.decoder().config().rays) {
        sampling.samples_per_ray = options.samples_per_ray;
        rays.samples_per_ray = options.samples_per_ray;
        rays.rays.resize(static_cast<std::size_t>(sampling.rays_per_side * sampling.rays_per_side));
        rays.known.resize(rays.rays.size());
        const std::int64_t rays_per_side = sampling.rays_per_side;
        const std::int64_t side =
            options.resolution == 0 ? model.config().decoder.resolution : options.resolution;
        view.image = Tensor({side, side, 3});
        if (options.mask) view.mask = Tensor({side, side, 1});
        if (options.depth) {
            view.depth = Tensor({rays_per_side, rays_per_side, 1});
            view.opacity = Tensor({rays_per_side, rays_per_side, 1});
        }
        counts.samples = static_cast<std::int64_t>(rays.rays.size()) * options.samples_per_ray;
    }

    /// Copies row `index` of one group; true if it differs from the codes that are shown.
    bool take(const Codes& codes, std::int64_t index, std::size_t group);
    void fold_field();
    void fold_blocks();
    void render_field(const Camera& seen_by, const std::stop_token& stop);
    void draw(const std::stop_token& stop);
    void copy_field();
    void count(FrameParts parts);
    /// Renders with the decoder that training uses, for layers that do not fold.
    [[nodiscard]] View render_unfolded(const Camera& seen_by);
};

namespace {

void require_row(const Codes& codes, std::int64_t index, std::size_t group) {
    const std::int64_t size = code_sizes[group];
    const Tensor& values = codes.groups[group].value();
    if (values.rank() != 2 || values.shape(1) != size || index < 0 || index >= values.shape(0))
        fail<ShapeError>("code ", code_names[group], " of face ", index,
                         " must be a row of (faces, ", size, "), got ", values.shape());
}

}  // namespace

bool FaceRenderer::State::take(const Codes& codes, std::int64_t index, std::size_t group) {
    const std::int64_t size = code_sizes[group];
    const auto row = codes.groups[group].value().values<float>().subspan(
        static_cast<std::size_t>(index * size), static_cast<std::size_t>(size));
    if (std::ranges::equal(row, shown[group])) return false;
    shown[group].assign(row.begin(), row.end());
    return true;
}

void FaceRenderer::State::render_field(const Camera& seen_by, const std::stop_token& stop) {
    if (camera && *camera == seen_by) {
        feature_map.field_samples = feature_map.grid_points = feature_map.tiles = 0;
        return;
    }
    camera.reset();
    for (std::int64_t i = 0; i < static_cast<std::int64_t>(rays.rays.size()); ++i) {
        const auto index = static_cast<std::size_t>(i);
        rays.rays[index] =
            camera_ray(seen_by, sampling, i / sampling.rays_per_side, i % sampling.rays_per_side);
        rays.known[index] = samples_in_trained_volume(model.config().camera, seen_by,
                                                      rays.rays[index], sampling.samples_per_ray);
    }
    field->render(rays, feature_map, stop);
    if (stop.stop_requested()) return;
    view.background_depth = farthest_sample(rays);
    if (options.remove_floaters)
        floaters.apply(feature_map, sampling.rays_per_side, view.background_depth);
    camera = seen_by;
    feature_map_is_new = true;
}

void FaceRenderer::State::fold_field() {
    camera.reset();
    field->set_field(model.decoder().folded_field(w));
    ++counts.folds;
}

void FaceRenderer::State::fold_blocks() {
    const std::vector<FoldedRenderBlock> folded =
        model.decoder().folded_blocks(w, options.resolution);
    ++counts.folds;
    if (blocks) {
        blocks->set_style(folded);
        return;
    }
    const DecoderConfig& decoder = model.config().decoder;
    const std::optional<FoldedMaskBranch> mask = options.mask
                                                     ? std::optional(model.decoder().folded_mask())
                                                     : std::optional<FoldedMaskBranch>();
    blocks.emplace(folded, mask, decoder.rays.rays_per_side,
                   options.resolution == 0 ? decoder.resolution : options.resolution,
                   products_of(options.mode));
    feature_map_is_new = true;
}

void FaceRenderer::State::draw(const std::stop_token& stop) {
    if (feature_map_is_new) blocks->set_feature_map(feature_map.features, feature_map.occupied);
    feature_map_is_new = false;
    blocks->render(view.image.mutable_values<float>(),
                   options.mask ? view.mask.mutable_values<float>() : std::span<float>(), stop);
}

void FaceRenderer::State::copy_field() {
    if (!options.depth) return;
    std::ranges::copy(feature_map.depths, view.depth.mutable_values<float>().begin());
    std::ranges::copy(feature_map.opacities, view.opacity.mutable_values<float>().begin());
}

void FaceRenderer::State::count(FrameParts parts) {
    counts.field_samples = feature_map.field_samples;
    counts.grid_points = feature_map.grid_points;
    counts.pixels = blocks->counts().pixels;
    counts.pixels_computed = parts == FrameParts::all ? blocks->counts().pixels_computed : 0;
    counts.tiles = feature_map.tiles;
    view.significant_samples =
        static_cast<double>(feature_map.significant_samples) / static_cast<double>(counts.samples);
    const Decoder& decoder = model.decoder();
    const LayerCount all = layer_count(decoder, decoder.ladder().largest(), true);
    const LayerCount shown_layers = layer_count(decoder, view.image.shape(0), options.mask);
    counts.layers = all.field + all.image;
    counts.layers_computed = (counts.field_samples > 0 ? shown_layers.field : 0) +
                             (counts.pixels_computed > 0 ? shown_layers.image : 0);
}

View FaceRenderer::State::render_unfolded(const Camera& seen_by) {
    const ViewOptions wanted{.samples_per_ray = options.samples_per_ray,
                             .resolution = options.resolution,
                             .mask = options.mask,
                             .depth = options.depth};
    counts.samples = model.decoder().work(options.resolution).rays * options.samples_per_ray;
    counts.field_samples = counts.samples;
    return decoded_view(model, z, 0, seen_by, wanted);
}

FaceRenderer::FaceRenderer(const Model& model, const RendererOptions& options) {
    require_valid(model, options);
    state_ = std::make_unique<State>(model, options);
}
FaceRenderer::~FaceRenderer() = default;
FaceRenderer::FaceRenderer(FaceRenderer&&) noexcept = default;

void FaceRenderer::show(const Codes& codes, std::int64_t index) {
    State& state = *state_;
    std::array<bool, code_names.size()> changed{};
    for (std::size_t group = 0; group < changed.size(); ++group) require_row(codes, index, group);
    for (std::size_t group = 0; group < changed.size(); ++group)
        changed[group] = state.take(codes, index, group);
    if (std::ranges::none_of(changed, [](bool group) { return group; })) return;

    for (std::size_t group = 0; group < changed.size(); ++group)
        state.z.groups[group] = Tensor::from({1, code_sizes[group]}, state.shown[group]);
    if (!state.field) return;
    try {
        state.w = detached(state.model.decoder().map(state.z));
        if (changed[0] || changed[1]) state.fold_field();
        if (changed[2] || changed[3]) state.fold_blocks();
    } catch (...) {
        // Nothing is shown then, so that the next call folds all layers.
        for (std::vector<float>& group : state.shown) group.clear();
        throw;
    }
}

View FaceRenderer::render(const Camera& camera) {
    return *render(camera, std::stop_token());
}

std::optional<View> FaceRenderer::render(const Camera& camera, const std::stop_token& stop,
                                         FrameParts parts) {
    State& state = *state_;
    if (state.shown.front().empty()) fail<ValueError>("there is no face to render; show one first");
    if (!state.field) return state.render_unfolded(camera);
    state.render_field(camera, stop);
    if (stop.stop_requested()) return std::nullopt;
    if (parts == FrameParts::all) state.draw(stop);
    if (stop.stop_requested()) return std::nullopt;
    state.copy_field();
    state.count(parts);
    // Without render blocks the image is that of an earlier frame, or was never written.
    if (parts == FrameParts::all) {
        require_finite(state.view);
    } else if (state.view.depth.defined()) {
        require_finite(state.view.depth);
    }
    return state.view;
}

void FaceRenderer::set_tolerance(double tolerance) {
    require_tolerance(tolerance);
    State& state = *state_;
    if (tolerance == state.options.tolerance) return;
    state.options.tolerance = tolerance;
    if (!state.field || !tolerates(state.options.mode)) return;
    state.field->set_tolerance(tolerance);
    state.camera.reset();
}

const RenderCounts& FaceRenderer::counts() const {
    return state_->counts;
}

}  // namespace stymo
