#include "fit/fitter.h"

#include <algorithm>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "nn/optim/adam.h"

namespace stymo {

namespace {

/// The code offsets as parameters of their own.
struct Offsets {
    ParameterStore store;

    explicit Offsets(const Codes& codes) {
        for (std::size_t group = 0; group < code_names.size(); ++group) {
            store.create(std::string("offset.") + code_names[group],
                         Tensor::zeros(codes.groups[group].shape(), codes.groups[group].dtype()));
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
    result.initial = detached(model.encoder()(Variable(target.input)));
    const auto batch = static_cast<double>(result.initial.batch());
    const Offsets offsets(result.initial);
    ReconstructionLoss::Target photos;
    if (options.steps > 0) photos = reconstruction_loss.kept_target(target.targets);
    Adam adam;
    double learning_rate = options.learning_rate;
    for (std::int64_t step = 0; step < options.steps && !interrupted(); ++step) {
        const Codes codes = add(result.initial, offsets.codes());
        if (options.tolerance > 0.0 && step % options.examination_interval == 0) {
            decode.kept_samples = significant_samples(
                model.decoder().compositing_weights(codes, target.cameras, decode.samples_per_ray), options.tolerance);
            decode.keep_field = options.keep_field || mean_of(decode.kept_samples) <= few_samples;
        }
        const Decoded decoded = model.decoder()(codes, target.cameras, decode);
        // A mean over the batch times its size: the faces' gradients do not depend on how many are fitted together.
        const Variable loss =
            reconstruction_loss(decoded.images, photos).total * batch + squared_length(offsets.codes()) * regularizer;
        result.losses.push_back(loss.value().item() / batch);
        if (!std::isfinite(result.losses.back()))
            fail<NumericError>("fitting step ", step, ": the loss is not finite; lower the learning rate");
        const std::vector<Variable> gradients = grad(loss, variables_of(offsets.store.all()));
        adam.step(offsets.store.all(), gradients, learning_rate);
        learning_rate *= options.decay;
        if (options.on_step) options.on_step(step + 1, result.losses.back());
    }
    result.fitted = detached(add(result.initial, offsets.codes()));
    return result;
}

}  // namespace stymo
