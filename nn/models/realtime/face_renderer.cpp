#include "nn/models/realtime/face_renderer.h"

#include <algorithm>
#include <array>
#include <optional>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/models/picture.h"
#include "nn/models/realtime/baked_field.h"
#include "nn/models/realtime/sampled_field.h"

namespace stymo {
namespace {

bool same(const Camera& a, const Camera& b) {
    return a.center == b.center && a.world_from_camera == b.world_from_camera && a.intrinsics.focal == b.intrinsics.focal &&
           a.intrinsics.center_x == b.intrinsics.center_x && a.intrinsics.center_y == b.intrinsics.center_y;
}

void require_valid(const Model& model, const RendererOptions& options) {
    if (options.samples_per_ray < 2) fail<ValueError>("a ray needs at least 2 samples, got ", options.samples_per_ray);
    if (!(options.tolerance >= 0.0 && options.tolerance < 1.0))
        fail<ValueError>("the tolerance must be from 0 to below 1, got ", options.tolerance);
    const DecoderConfig& decoder = model.config().decoder;
    std::string sides;
    for (std::int64_t side = 2 * decoder.rays.rays_per_side; side <= decoder.resolution; side *= 2) {
        if (options.resolution == 0 || side == options.resolution) return;
        sides += (sides.empty() ? "" : ", ") + std::to_string(side);
    }
    fail<ValueError>("this model renders pictures with a side of ", sides, ", not ", options.resolution);
}

std::unique_ptr<FieldSource> make_field_source(const ModelConfig& model, const RendererOptions& options) {
    if (options.mode == RenderMode::baked) {
        RaySampling rays = model.decoder.rays;
        rays.samples_per_ray = options.samples_per_ray;
        return std::make_unique<BakedField>(rays, BakedViews{.camera = model.camera},
                                            BakeOptions{.resolution = options.bake_resolution, .tolerance = options.tolerance});
    }
    return make_sampled_field(model, options);
}

}  // namespace

struct FaceRenderer::State {
    const Model& model;
    RendererOptions options;
    std::unique_ptr<FieldSource> field;
    std::array<std::vector<float>, code_names.size()> shown;  ///< codes in Z
    Codes w;
    RaySampling sampling;
    CameraRays rays;
    std::optional<Camera> camera;  ///< whose feature map is kept
    FeatureMap feature_map;
    RenderCounts counts;

    State(const Model& shown_model, const RendererOptions& renderer_options)
        : model(shown_model),
          options(renderer_options),
          field(make_field_source(shown_model.config(), renderer_options)),
          sampling(shown_model.decoder().config().rays) {
        sampling.samples_per_ray = options.samples_per_ray;
        rays.samples_per_ray = options.samples_per_ray;
        rays.rays.resize(static_cast<std::size_t>(sampling.rays_per_side * sampling.rays_per_side));
        counts.samples = static_cast<std::int64_t>(rays.rays.size()) * options.samples_per_ray;
    }

    /// Takes over row `index` of one group; true if it differs from what is shown.
    bool take(const Codes& codes, std::int64_t index, std::size_t group);
    void look(const Camera& seen_by);
    [[nodiscard]] View view() const;
};

bool FaceRenderer::State::take(const Codes& codes, std::int64_t index, std::size_t group) {
    const std::int64_t size = code_sizes[group];
    const Tensor& values = codes.groups[group].value();
    if (values.rank() != 2 || values.shape(1) != size || index < 0 || index >= values.shape(0)) {
        fail<ShapeError>("code ", code_names[group], " of face ", index, " must be a row of (faces, ", size, "), got ",
                         values.shape());
    }
    const auto row = values.values<float>().subspan(static_cast<std::size_t>(index * size), static_cast<std::size_t>(size));
    if (std::ranges::equal(row, shown[group])) return false;
    shown[group].assign(row.begin(), row.end());
    return true;
}

void FaceRenderer::State::look(const Camera& seen_by) {
    if (camera && same(*camera, seen_by)) {
        feature_map.field_samples = 0;
        return;
    }
    camera.reset();
    for (std::int64_t i = 0; i < static_cast<std::int64_t>(rays.rays.size()); ++i) {
        rays.rays[static_cast<std::size_t>(i)] =
            camera_ray(seen_by, sampling, i / sampling.rays_per_side, i % sampling.rays_per_side);
    }
    field->look(rays, feature_map);
    camera = seen_by;
}

View FaceRenderer::State::view() const {
    const std::int64_t side = sampling.rays_per_side;
    const Tensor features = Tensor::from({1, side, side, model.config().decoder.feature_channels}, feature_map.features);
    const Decoded decoded =
        model.decoder().decode_feature_map(features, w, {.resolution = options.resolution, .mask = options.mask});
    View result{picture(decoded.images.back().value(), 0), {}, {}};
    if (options.mask) result.mask = picture_mask(sigmoid(decoded.mask_logit).value(), 0);
    if (options.depth) result.depth = Tensor::from({side, side, 1}, feature_map.depths);
    return result;
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
    for (std::size_t group = 0; group < changed.size(); ++group) changed[group] = state.take(codes, index, group);
    if (std::ranges::none_of(changed, [](bool group) { return group; })) return;

    Codes z;
    for (std::size_t group = 0; group < changed.size(); ++group)
        z.groups[group] = Tensor::from({1, code_sizes[group]}, state.shown[group]);
    state.w = detached(state.model.decoder().map(z));
    if (changed[0] || changed[1]) {
        state.camera.reset();
        state.field->set_field(state.model.decoder().folded_field(state.w));
        ++state.counts.folds;
    }
}

View FaceRenderer::render(const Camera& camera) {
    State& state = *state_;
    if (state.shown.front().empty()) fail<ValueError>("there is no face to render; show one first");
    state.look(camera);
    state.counts.field_samples = state.feature_map.field_samples;
    return state.view();
}

const RenderCounts& FaceRenderer::counts() const {
    return state_->counts;
}

}  // namespace stymo
