#include "fit/fit_problem.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/image_augmentation.h"
#include "nn/known_pixels.h"
#include "nn/models/camera_problem.h"
#include "nn/models/identity_network.h"
#include "nn/models/significant_rows.h"
#include "nn/realtime/view.h"
#include "render/tracked_rays.h"

namespace stymo {

namespace {

/// Identity and texture (in the order of `code_names`) are the same in all photos of a person.
bool is_of_person(std::size_t group) {
    return group == 0 || group == 2;
}

/// Codes whose identity and texture are the mean of all rows.
Codes of_one_person(Codes codes) {
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        Variable& values = codes.groups[group];
        if (is_of_person(group)) values = broadcast_to(mean(values, {0}), values.shape());
    }
    return codes;
}

/// The yaw (radians) of the sides, and the most pixels of their images, of which the identity
/// network sees 112.
constexpr double side_yaw = 0.5;
constexpr std::int64_t side_pixels = 128;

/// Largest share of significant samples for which keeping the field's arguments takes little
/// memory.
constexpr double few_samples = 0.25;

/// The cameras moved aside by `yaw`, except those that would leave the model's range, as that of a
/// profile. Empty if none can be moved.
std::vector<Camera> cameras_aside(const DecoderConfig& config, const std::vector<Camera>& cameras,
                                  double yaw) {
    std::vector<Camera> aside;
    std::size_t moved = 0;
    for (const Camera& camera : cameras) {
        const Camera turned = turned_about_head(camera, yaw, 0.0);
        const bool allowed = !camera_problem(config, turned).has_value();
        moved += allowed ? 1 : 0;
        aside.push_back(allowed ? turned : camera);
    }
    return moved > 0 ? aside : std::vector<Camera>{};
}

double mean_of(const Tensor& values) {
    return mean(Variable(values)).value().item();
}

void require_sound(const FaceBatch& faces, const FitOptions& options) {
    if (faces.targets.empty()) fail<ShapeError>("fitting: no targets");
    if (options.selection_interval < 1)
        fail<ValueError>("fitting: samples are selected every ", options.selection_interval,
                         " steps; give at least 1");
}

Codes initial_codes(const Model& model, const FaceBatch& faces, const FitOptions& options) {
    require_sound(faces, options);
    Codes codes = detached(options.initial ? *options.initial : face_codes(model, faces));
    return options.one_person ? of_one_person(std::move(codes)) : codes;
}

}  // namespace

FitProblem::FitProblem(const Model& model, const ReconstructionLoss& loss, const FaceBatch& faces,
                       const FitOptions& options)
    : model_(model),
      loss_(loss),
      faces_(faces),
      options_(options),
      weights_(options.weights),
      heads_(options.weights.depth > 0.0 ? options.head : nullptr, faces),
      initial_(initial_codes(model, faces, options)) {
    if (weights_.regularizer < 0.0)
        weights_.regularizer = model.config().reconstruction.fit_regularizer;
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        if (!options.fitted_groups[group]) continue;
        const Variable& values = initial_.groups[group];
        const std::int64_t rows = options.one_person && is_of_person(group) ? 1 : initial_.batch();
        offsets_.create(std::string("offset.") + code_names[group],
                        Tensor::zeros({rows, values.shape(1)}, values.dtype()));
    }
    if (options.refine_pose)
        orbits_.create("orbits", orbit_parameters(faces.cameras, initial_.identity().dtype()));
    const std::int64_t own = model.config().reconstruction.fit_samples_per_ray;
    decode_.samples_per_ray = options.samples_per_ray > 0 ? options.samples_per_ray : own;
    decode_.keep_field = options.keep_field;
    const bool person = options.fitted_groups[0] || options.fitted_groups[2];
    if (person && weights_.identity > 0.0 && model.has_encoder() && model.encoder().knows_faces())
        photo_embeddings_ =
            face_embeddings(model, faces.targets.back(), faces.cameras, faces.known).value();
    for (std::size_t i = 0; i < sides_.size() && photo_embeddings_.defined(); ++i) {
        sides_[i].cameras =
            cameras_aside(model.config().decoder, faces.cameras, i == 0 ? -side_yaw : side_yaw);
        sides_[i].decode.samples_per_ray = decode_.samples_per_ray;
        sides_[i].decode.resolution = faces.targets.front().shape(1);
        for (const Tensor& images : faces.targets)
            if (images.shape(1) <= side_pixels) sides_[i].decode.resolution = images.shape(1);
    }
}

Variable FitProblem::side_embeddings(const Codes& codes) const {
    const Decoded decoded = model_.decoder()(codes, side_->cameras, side_->decode);
    return face_embeddings(model_, decoded.images.back(), side_->cameras);
}

Codes FitProblem::code_offsets() const {
    Codes result;
    std::size_t next = 0;
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        const Variable& values = initial_.groups[group];
        result.groups[group] = options_.fitted_groups[group]
                                   ? offsets()[next++].variable()
                                   : Variable(Tensor::zeros(values.shape(), values.dtype()));
    }
    return result;
}

Codes FitProblem::codes() const {
    Codes moves = code_offsets();
    if (options_.expression_directions.defined())
        moves.groups[1] = matmul(moves.groups[1], options_.expression_directions);
    return add(initial_, moves);
}

std::vector<Camera> FitProblem::cameras() const {
    if (orbits().empty()) return faces_.cameras;
    return cameras_at(orbits().front().variable().value(), faces_.cameras);
}

bool FitProblem::select_samples() {
    if (options_.tolerance <= 0.0) return false;
    decode_.significant_samples =
        significant_samples(model_.decoder().compositing_weights(
                                codes(), cameras(), decode_.samples_per_ray, decode_.resolution),
                            options_.tolerance);
    decode_.keep_field = options_.keep_field || mean_of(decode_.significant_samples) <= few_samples;
    for (Side& side : sides_) side.decode.significant_samples = {};
    return true;
}

void FitProblem::choose_side(std::int64_t step) {
    side_ = nullptr;
    if (!photo_embeddings_.defined() || step % 2 == 0) return;
    Side& side = sides_[static_cast<std::size_t>(step / 2 % 2)];
    if (side.cameras.empty()) return;
    side_ = &side;
    if (options_.tolerance > 0.0 && !side.decode.significant_samples.defined())
        side.decode.significant_samples = significant_samples(
            model_.decoder().compositing_weights(codes(), side.cameras, side.decode.samples_per_ray,
                                                 side.decode.resolution),
            options_.tolerance);
}

bool FitProblem::choose_images(std::int64_t step) {
    const std::size_t all = faces_.targets.size();
    std::size_t count = all;
    if (step < options_.coarse_steps)
        count = 1 + static_cast<std::size_t>(step) * (all - 1) /
                        static_cast<std::size_t>(options_.coarse_steps);
    count = std::min(count, all);
    if (count == image_count_) return false;
    image_count_ = count;
    photos_ = loss_.kept_target(std::span(faces_.targets).first(count), faces_.known);
    weigh_largest(photos_.weights, count, model_.decoder());
    decode_.resolution = faces_.targets[count - 1].shape(1);
    return true;
}

std::vector<std::optional<FaceSurface>> FitProblem::aligned_surfaces(const Variable& depths) {
    const std::vector<Camera> seen_by = cameras();
    const auto side = std::llround(std::sqrt(static_cast<double>(depths.shape(1))));
    std::vector<std::optional<FaceSurface>> surfaces;
    for (std::int64_t row = 0; row < depths.shape(0); ++row) {
        const Tensor depth = slice(depths, 0, row, row + 1).value();
        const Camera& camera = seen_by[static_cast<std::size_t>(row)];
        heads_.align(row, camera, depth.to(DType::float32).reshaped({side, side, 1}));
        surfaces.push_back(heads_.surface(row, camera, side));
    }
    return surfaces;
}

FitLoss FitProblem::loss_here() {
    if (!orbits().empty()) decode_.orbits = orbits().front().variable();
    const Codes codes_now = codes();
    const Decoded decoded = model_.decoder()(codes_now, cameras(), decode_);
    const Codes offsets_now = code_offsets();
    FitComparison seen{.decoded = decoded,
                       .reconstruction = &loss_,
                       .photos = &photos_,
                       .offsets = &offsets_now,
                       .expressions = codes_now.expression(),
                       .expression_before = options_.expression_before,
                       .heads = &heads_};
    std::vector<std::optional<FaceSurface>> surfaces;
    if (!heads_.empty()) {
        seen.depths = expected_depth(decoded);
        surfaces = aligned_surfaces(seen.depths);
        seen.surfaces = surfaces;
    }
    if (photo_embeddings_.defined()) {
        seen.embeddings =
            face_embeddings(model_, decoded.images.back(), faces_.cameras, faces_.known);
        if (side_ != nullptr) seen.side_embeddings = side_embeddings(codes_now);
        seen.photo_embeddings = photo_embeddings_;
    }
    return fit_loss(seen, weights_);
}

double FitProblem::complete_loss() {
    static_cast<void>(choose_images(options_.coarse_steps));
    side_ = nullptr;
    const DecodeOptions of_steps = decode_;
    decode_.significant_samples = {};
    decode_.keep_field = false;  // no gradient follows
    const double loss = mean_over_faces(loss_here().total);
    decode_ = of_steps;
    return loss;
}

FitProblem::Evaluation FitProblem::evaluate() {
    FitLoss loss = loss_here();
    Evaluation result{mean_over_faces(loss.total), std::move(loss.terms), {}};
    // Steps with and without a side are compared with each other.
    for (const auto& [name, value] : result.terms)
        if (name == "side_identity")
            result.loss -= FitWeights::side_share * weights_.identity * value;
    std::vector<Variable> learnt = variables_of(offsets());
    if (!orbits().empty()) learnt.push_back(orbits().front().variable());
    result.gradients = grad(loss.total, learnt);
    return result;
}

}  // namespace stymo
