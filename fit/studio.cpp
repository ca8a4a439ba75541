#include "fit/studio.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>
#include <utility>

#include "core/angle.h"
#include "core/error.h"
#include "core/subnormals.h"
#include "fit/shipped_files.h"
#include "nn/models/weight_changes.h"
#include "nn/realtime/view.h"
#include "render/morphable/builtin_head.h"
#include "render/soft_edge.h"

namespace stymo {

namespace {

std::filesystem::path model_file(const std::filesystem::path& model,
                                 const std::filesystem::path& configs) {
    std::filesystem::path file = named_model(model, configs);
    if (file.empty())
        fail<FileError>("the model that comes with stymo was not found",
                        configs.empty() ? "" : " in " + configs.string(), "; name a model's file");
    return file;
}

/// An infinite time would never end.
void require_finite(double seconds) {
    if (!std::isfinite(seconds))
        fail<ValueError>("tuning takes a finite number of seconds, not ", seconds);
}

}  // namespace

struct Studio::State {
    State(const std::filesystem::path& file, std::filesystem::path folder)
        : model(Model::load(file)), mark(model_mark(file)), configs(std::move(folder)) {}

    Model model;
    std::string mark;
    std::filesystem::path configs;

    std::mutex rendering{};
    std::shared_ptr<const Model> tuned{};  ///< what `renderer` renders; null: `model`
    RendererOptions options{};
    std::optional<FaceRenderer> renderer{};

    /// The renderer of the last view, which is kept for the next one.
    FaceRenderer& renderer_for(const std::shared_ptr<const Model>& decoder,
                               const RendererOptions& wanted) {
        if (!renderer || tuned != decoder || !(options == wanted)) {
            renderer.reset();
            renderer.emplace(decoder ? *decoder : model, wanted);
            tuned = decoder;
            options = wanted;
        }
        return *renderer;
    }

    void require_own(const StudioFace& face) const {
        if (!face.face.model.empty() && face.face.model != mark)
            fail<ValueError>("this face is one of another model");
    }

    [[nodiscard]] StudioFace run(const Face& photo, FitJobOptions fit_options,
                                 const FitObserver& observer) const {
        const ReconstructionConfig& config = model.config().reconstruction;
        const ReconstructionLoss loss(config, "stymo-fit --perceptual-weight 0",
                                      model.has_encoder() ? &model.encoder() : nullptr);
        const FitJob job(model, loss, std::move(fit_options));
        FittedFaces done = job.fit(job.batch_of({&photo, 1}), observer);
        const FitReport report = job.report(done, 0, done.faces.mask, nullptr);
        StudioFace result{.face = {.codes = detached(done.fit.fitted),
                                   .pose = pose_from_camera(done.fit.cameras.front()),
                                   .model = mark},
                          .photo = photo,
                          .psnr = report.fitted_metrics.psnr,
                          .warnings = std::move(done.warnings)};
        result.photo->pose = result.face.pose;
        if (done.tuned) {
            result.tuned = std::make_shared<const Model>(std::move(*done.tuned));
            result.changes = std::make_shared<const WeightChanges>(std::move(*done.changes));
            result.psnr = report.tuned_metrics.psnr;
        }
        if (!done.incomplete.empty()) result.warnings.push_back(done.incomplete);
        return result;
    }
};

Studio::Studio(std::filesystem::path model, std::filesystem::path configs)
    : state_(std::make_unique<State>(model_file(model, configs), configs)) {}
Studio::~Studio() = default;
Studio::Studio(Studio&&) noexcept = default;
Studio& Studio::operator=(Studio&&) noexcept = default;

const Model& Studio::model() const {
    return state_->model;
}

FitJobOptions Studio::fit_options() const {
    FitJobOptions options;
    options.preparation.landmark_model = shipped_landmark_network(state_->configs);
    options.preparation.mask_network = shipped_mask_network(state_->configs);
    options.head.emplace();
    return options;
}

StudioFace Studio::fit(const Tensor& photo, const FitJobOptions& options,
                       const FitObserver& observer) const {
    if (photo.rank() != 3 || photo.shape(2) != 3)
        fail<ShapeError>("the photo must have the shape (height, width, 3), not ", photo.shape());
    if (!std::ranges::all_of(photo.values<float>(), [](float x) { return x >= 0.0F && x <= 1.0F; }))
        fail<ValueError>("the values of the photo must be from 0 to 1");
    require_finite(options.tuning.seconds);
    const SubnormalsFlushed flushed;
    const ModelConfig& config = state_->model.config();
    PreparedPhoto prepared = prepare_photo(
        photo, "the photo", config, PhotoPreparation(settings_for(config, options.preparation)));
    StudioFace result = state_->run(prepared.face, options, observer);
    if (options.preparation.pose_network.empty()) result.head = options.head;
    result.warnings.insert(result.warnings.end(), prepared.warnings.begin(),
                           prepared.warnings.end());
    return result;
}

StudioFace Studio::tune(const StudioFace& face, double seconds, std::int64_t steps,
                        const FitObserver& observer) const {
    if (!face.photo)
        fail<ValueError>("only a face that was fitted to a photo here can be tuned to it");
    state_->require_own(face);
    require_finite(seconds);
    if (seconds <= 0.0 && steps <= 0)
        fail<ValueError>("tuning needs a limit, in seconds or steps, above 0");
    const SubnormalsFlushed flushed;
    FitJobOptions options = fit_options();
    options.head = face.head;
    options.fit.initial = face.face.codes;
    options.fit.steps = 0;
    options.tuning.seconds = seconds;
    options.tuning.steps = steps;
    StudioFace result = state_->run(*face.photo, std::move(options), observer);
    result.head = face.head;
    if (face.tuned && face.psnr && result.psnr && *result.psnr < *face.psnr) {
        result = face;
        result.warnings.emplace_back(
            "tuning begins anew and ended below the earlier one, which stays; give it more time");
    }
    return result;
}

View Studio::render(const StudioFace& face, const StudioView& view) const {
    for (const std::optional<double>& angle : {view.yaw, view.pitch, view.roll})
        if (angle && !std::isfinite(*angle)) fail<ValueError>("an angle is ", *angle, " degrees");
    state_->require_own(face);
    const Model& model = state_->model;
    const Camera camera = view.yaw || view.pitch || view.roll
                              ? turned_camera(model.config().camera, head_middle,
                                              radians_from_degrees(view.yaw.value_or(0.0)),
                                              radians_from_degrees(view.pitch.value_or(0.0)),
                                              radians_from_degrees(view.roll.value_or(0.0)))
                              : camera_from_pose(face.face.pose, model.config().camera.intrinsics);
    const SubnormalsFlushed flushed;
    const std::scoped_lock lock(state_->rendering);
    RendererOptions options = view.options;
    options.mask = options.mask || !view.raw;
    FaceRenderer& renderer = state_->renderer_for(face.tuned, options);
    renderer.show(face.face.codes);
    View seen = renderer.render(camera);
    if (!view.raw) seen.image = with_soft_edge(seen.image, seen.mask);
    if (!view.options.mask) seen.mask = Tensor();
    return seen;
}

FaceMesh Studio::mesh(const StudioFace& face, std::int64_t texture_side, bool neutral) const {
    if (texture_side < 64 || texture_side > 8192 ||
        !std::has_single_bit(static_cast<std::uint64_t>(texture_side)))
        fail<ValueError>("a texture has a side of 64, 128, 256 ... 8192 pixels, not ",
                         texture_side);
    state_->require_own(face);
    const std::filesystem::path landmarks = shipped_landmark_network(state_->configs);
    if (landmarks.empty()) fail<FileError>("the landmark network of stymo was not found");
    const SubnormalsFlushed flushed;
    return face_mesh(face.tuned ? *face.tuned : state_->model, face.face.codes, builtin_head(),
                     read_landmark_model(landmarks), texture_side, neutral);
}

StudioFace Studio::sample(std::uint64_t seed, std::uint64_t index, double truncation) const {
    const std::optional<CodeStatistics>& statistics = state_->model.code_statistics();
    if (!statistics) fail<ValueError>("the model has no statistics of codes to draw faces from");
    return {.face = {.codes = statistics->new_face(seed, index, truncation),
                     .pose = frontal_pose(state_->model.config().camera),
                     .model = state_->mark}};
}

StudioFace Studio::read(const std::filesystem::path& codes,
                        const std::filesystem::path& tuned) const {
    StudioFace result{.face = read_code_file(codes, state_->mark)};
    if (tuned.empty()) return result;
    WeightChanges changes = WeightChanges::load(tuned);
    try {
        result.tuned = std::make_shared<const Model>(changes.applied_to(state_->model));
    } catch (const ValueError& error) {
        fail<FileError>(tuned.string(), ": ", error.what());
    }
    result.changes = std::make_shared<const WeightChanges>(std::move(changes));
    return result;
}

Tensor tensor_from_bytes(std::span<const std::uint8_t> pixels, const Shape& shape) {
    constexpr float step = 1.0F / 255.0F;  // a division would round differently
    std::vector<float> values(pixels.size());
    std::ranges::transform(pixels, values.begin(),
                           [](std::uint8_t pixel) { return static_cast<float>(pixel) * step; });
    return Tensor::from(shape, values);
}

StudioFace mix(const StudioFace& target, const StudioFace& source, const std::string& take) {
    const std::string &of_target = target.face.model, &of_source = source.face.model;
    if (!of_target.empty() && !of_source.empty() && of_target != of_source)
        fail<ValueError>("the two faces are of two models");
    StudioFace result = target;
    result.face.codes = mix_codes(target.face.codes, source.face.codes, code_groups_of(take));
    result.photo.reset();
    result.psnr.reset();
    result.warnings.clear();
    return result;
}

void write(const StudioFace& face, const std::filesystem::path& codes,
           const std::filesystem::path& tuned) {
    if (!tuned.empty()) {
        if (!face.changes) fail<ValueError>("the face is not tuned; leave out ", tuned.string());
        face.changes->save(tuned);
    }
    write_code_file(codes, face.face.codes, 0, face.face.pose, face.face.model);
}

}  // namespace stymo
