#include "fit/fitter.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "nn/optim/adam.h"
#include "render/tracked_rays.h"

namespace stymo {

namespace {

/// Identity and texture, in the order of `code_names`, stay from photo to photo.
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

/// The cameras' poses as parameters of their own.
struct Orbits {
    ParameterStore store;

    Orbits(const std::vector<Camera>& cameras, DType dtype) {
        std::vector<Pose> poses;
        for (const Camera& camera : cameras) poses.push_back(pose_from_camera(camera));
        store.create("orbits", orbit_parameters(poses, dtype));
    }

    [[nodiscard]] const Variable& parameters() const { return store.all().front().variable(); }

    [[nodiscard]] std::vector<Camera> cameras(std::vector<Camera> cameras) const {
        for (std::size_t i = 0; i < cameras.size(); ++i)
            cameras[i] =
                camera_from_pose(pose_from_orbit(parameters().value(), static_cast<std::int64_t>(i)), cameras[i].intrinsics);
        return cameras;
    }
};

/// The code offsets as parameters of their own.
struct Offsets {
    ParameterStore store;

    Offsets(const Codes& codes, bool one_person) {
        for (std::size_t group = 0; group < code_names.size(); ++group) {
            const Variable& values = codes.groups[group];
            const std::int64_t rows = one_person && is_of_person(group) ? 1 : codes.batch();
            store.create(std::string("offset.") + code_names[group], Tensor::zeros({rows, values.shape(1)}, values.dtype()));
        }
    }

    [[nodiscard]] Codes codes() const {
        Codes result;
        for (std::size_t group = 0; group < code_names.size(); ++group) result.groups[group] = store.all()[group].variable();
        return result;
    }
};

/// Share of the samples up to which keeping the field's arguments takes little memory.
constexpr double few_samples = 0.25;

double mean_of(const Tensor& values) {
    return mean(Variable(values)).value().item();
}

}  // namespace

Tensor significant_samples(const Tensor& weights, double tolerance) {
    Tensor result(weights.shape(), weights.dtype());
    dispatch(weights.dtype(), [&]<class T>(T) {
        std::ranges::transform(weights.values<T>(), result.mutable_values<T>().begin(),
                               [=](T weight) { return weight >= static_cast<T>(tolerance) ? T(1) : T(0); });
    });
    return result;
}

FitResult fit_codes(const Model& model, const ReconstructionLoss& reconstruction_loss, const FitTarget& target,
                    const FitOptions& options) {
    if (target.targets.empty()) fail<ShapeError>("fitting: no targets");
    const ReconstructionConfig& reconstruction = model.config().reconstruction;
    const double regularizer = options.regularizer < 0.0 ? reconstruction.fit_regularizer : options.regularizer;
    if (options.examination_interval < 1)
        fail<ValueError>("fitting: samples are examined every ", options.examination_interval, " steps; give at least 1");
    DecodeOptions decode{
        .samples_per_ray = options.samples_per_ray > 0 ? options.samples_per_ray : reconstruction.fit_samples_per_ray,
        .resolution = target.targets.back().shape(1),
        .keep_field = options.keep_field};
    FitResult result;
    result.initial = detached(target.initial ? *target.initial : model.encoder()(Variable(target.input)));
    if (options.one_person) result.initial = of_one_person(std::move(result.initial));
    result.cameras = target.cameras;
    const auto batch = static_cast<double>(result.initial.batch());
    const Offsets offsets(result.initial, options.one_person);
    std::optional<Orbits> orbits;
    if (options.refine_pose) orbits.emplace(target.cameras, result.initial.identity().dtype());
    ReconstructionLoss::Target photos;
    if (options.steps > 0) photos = reconstruction_loss.kept_target(target.targets);
    Adam adam;
    double learning_rate = options.learning_rate;
    for (std::int64_t step = 0; step < options.steps && !interrupted(); ++step) {
        const Codes codes = add(result.initial, offsets.codes());
        if (orbits) {
            result.cameras = orbits->cameras(std::move(result.cameras));
            decode.orbits = orbits->parameters();
        }
        if (options.tolerance > 0.0 && step % options.examination_interval == 0) {
            decode.kept_samples = significant_samples(
                model.decoder().compositing_weights(codes, result.cameras, decode.samples_per_ray, decode.resolution),
                options.tolerance);
            decode.keep_field = options.keep_field || mean_of(decode.kept_samples) <= few_samples;
        }
        const Decoded decoded = model.decoder()(codes, result.cameras, decode);
        // A mean over the batch times its size: the faces' gradients do not depend on how many are fitted together.
        const Variable loss =
            reconstruction_loss(decoded.images, photos).total * batch + squared_length(offsets.codes()) * regularizer;
        result.losses.push_back(loss.value().item() / batch);
        if (!std::isfinite(result.losses.back()))
            fail<NumericError>("fitting step ", step, ": the loss is not finite; lower the learning rate");
        std::vector<Variable> learnt = variables_of(offsets.store.all());
        if (orbits) learnt.push_back(orbits->parameters());
        const std::vector<Variable> gradients = grad(loss, learnt);
        const std::span of_codes = std::span(gradients).first(code_names.size());
        adam.step(offsets.store.all(), of_codes, learning_rate);
        if (orbits)
            adam.step(orbits->store.all(), std::span(gradients).subspan(code_names.size()),
                      learning_rate * options.pose_learning_rate_factor);
        learning_rate *= options.decay;
        if (options.on_step) options.on_step(step + 1, result.losses.back());
    }
    if (orbits) result.cameras = orbits->cameras(std::move(result.cameras));
    result.fitted = detached(add(result.initial, offsets.codes()));
    return result;
}

}  // namespace stymo
