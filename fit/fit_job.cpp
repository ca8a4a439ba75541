#include "fit/fit_job.h"

#include <algorithm>
#include <sstream>

#include "core/clock.h"
#include "core/interrupt.h"
#include "render/morphable/head_source.h"

namespace stymo {

namespace {

JsonValue json_of(const TermValues& terms) {
    JsonValue json = JsonValue::object();
    for (const auto& [name, value] : terms) json.add(name, value);
    return json;
}

bool moved(const FitResult& fit) {
    return !std::ranges::equal(fit.initial.groups, fit.fitted.groups, [](const auto& a, auto& b) {
        return a.value().to_vector() == b.value().to_vector();
    });
}

/// "loss 2.1 against 1.3".
std::string comparison(double after, double before) {
    std::ostringstream text;
    text << "loss " << after << " against " << before;
    return text.str();
}

/// Leaves the initial codes if the fit has not lowered the loss.
void keep_the_better(FittedFaces& done) {
    FitResult& fit = done.fit;
    if (fit.losses.empty() || fit.final_loss < fit.initial_loss) return;
    done.warnings.push_back(
        !moved(fit) ? "the fit did not move; lower --tolerance or raise --learning-rate"
                    : "the fit ended no better than it began (" +
                          comparison(fit.final_loss, fit.initial_loss) +
                          "), so the initial codes are kept; lower --learning-rate or --tolerance");
    fit.fitted = fit.initial;
    fit.cameras = done.faces.cameras;
}

/// The reconstruction loss of the photos with the fitted codes, mean over the faces.
double reconstruction_of(const Model& model, const ReconstructionLoss& loss,
                         const FittedFaces& done, std::int64_t samples_per_ray) {
    if (samples_per_ray == 0) samples_per_ray = model.config().reconstruction.fit_samples_per_ray;
    const Decoded decoded = model.decoder()(
        done.fit.fitted, done.fit.cameras,
        {.samples_per_ray = samples_per_ray, .resolution = done.faces.targets.back().shape(1)});
    return loss(decoded.images, loss.target(done.faces.targets, 0, done.faces.known))
        .total.value()
        .item();
}

}  // namespace

FitJob::FitJob(const Model& model, const ReconstructionLoss& loss, FitJobOptions options)
    : model_(model), loss_(loss), options_(std::move(options)) {
    // A network's pose differs from the one that the head was fitted with, by what it takes for
    // upright. Seen by it, the head's depth would be that of a tilted face.
    if (options_.head && options_.preparation.pose_network.empty())
        head_ = morphable_head_from(*options_.head);
    options_.fit.head = options_.tuning.head = nullptr;
    options_.tuning.samples_per_ray = options_.fit.samples_per_ray;
    options_.tuning.tolerance = options_.fit.tolerance;
}

const PhotoPreparation& FitJob::preparation() const {
    std::call_once(preparation_read_, [this] {
        preparation_.emplace(settings_for(model_.config(), options_.preparation));
    });
    return *preparation_;
}

std::vector<PreparedPhoto> FitJob::prepare(std::span<const std::string> images,
                                           const Tensor& known) const {
    return prepare_photos(images, model_.config(), preparation(), known);
}

FaceBatch FitJob::batch_of(std::span<const Face> faces) const {
    return make_batch(faces, model_.decoder().ladder().smallest(),
                      compared_side(model_.config().decoder, faces));
}

FittedFaces FitJob::unfitted(FaceBatch faces) const {
    FittedFaces done{.faces = std::move(faces)};
    done.fit = fit_codes(model_, loss_, done.faces, {.steps = 0});
    return done;
}

FitResult FitJob::fit_frames(const FaceBatch& frames, FitOptions options) const {
    options.head = head();
    return fit_codes(model_, loss_, frames, options);
}

FittedFaces FitJob::fit(FaceBatch faces, const FitObserver& observer) const {
    FittedFaces done{.faces = std::move(faces)};
    FitOptions options = options_.fit;
    options.one_person = done.faces.cameras.size() > 1;
    options.end_losses = true;  // which keep_the_better compares
    options.head = head();
    options.on_step = observer.on_fit_step;
    const std::int64_t side = done.faces.targets.back().shape(1);
    if (const std::int64_t largest = model_.config().decoder.resolution; side < largest)
        done.warnings.push_back("face and photo are compared at " + std::to_string(side) + " of " +
                                std::to_string(largest) + " pixels, since the photo has no more");
    const double start = seconds_now();
    done.fit = fit_codes(model_, loss_, done.faces, options);
    keep_the_better(done);
    done.fit_seconds = seconds_now() - start;
    if (observer.on_fitted) observer.on_fitted(done.fit);
    const std::int64_t steps = std::ssize(done.fit.losses);
    if (steps < options.steps && !done.fit.converged)
        done.incomplete = "interrupted after " + std::to_string(steps) + " of " +
                          std::to_string(options.steps) + " steps";
    else if (options_.tunes())
        tune(done, observer);
    return done;
}

void FitJob::tune(FittedFaces& done, const FitObserver& observer) const {
    done.incomplete = "interrupted while tuning; the fit is complete";
    if (interrupted()) return;
    TuningOptions options = options_.tuning;
    options.head = head();
    options.on_step = observer.on_tuning_step;
    std::optional<Model> tuned(model_.copy(ModelParts::decoder));
    done.tuning =
        tune_decoder(model_, *tuned, loss_, done.faces, done.fit.fitted, done.fit.cameras, options);
    if (interrupted()) return;
    const double before = reconstruction_of(model_, loss_, done, options.samples_per_ray);
    const double after = reconstruction_of(*tuned, loss_, done, options.samples_per_ray);
    if (!(after < before)) {
        done.warnings.push_back("tuning ended no better than it began (" +
                                comparison(after, before) +
                                "), so the decoder stays as it was; lower --tune-learning-rate");
        tuned.emplace(model_.copy(ModelParts::decoder));
    }
    constexpr std::int64_t few = 30;
    const std::int64_t steps = std::ssize(done.tuning.losses);
    if (options.steps == 0 && steps < few)
        done.warnings.push_back("tuning made only " + std::to_string(steps) +
                                (steps == 1 ? " step" : " steps") +
                                " in its time; give it more, or --tune-steps 100");
    done.changes = WeightChanges::between(model_, *tuned);
    done.changes->name_face(done.fit.fitted);
    done.tuned.emplace(done.changes->applied_to(model_));
    done.incomplete.clear();
}

FitReport FitJob::report(const FittedFaces& done, std::int64_t index, const Tensor& mask,
                         const Lpips* lpips, bool with_head_mask) const {
    FitReport report = report_fit(model_, done.faces, mask, done.fit, index, lpips, with_head_mask);
    if (done.tuned) add_tuned(report, *done.tuned, done.faces, mask, done.fit, index, lpips);
    return report;
}

JsonValue to_json(const FitReport& report, const FittedFaces& done) {
    JsonValue json = to_json(report, done.fit, done.fit_seconds);
    JsonValue terms = JsonValue::object({{"fitted", json_of(done.fit.terms)}});
    if (done.tuned) terms.add("tuned", json_of(done.tuning.terms));
    json.add("terms", terms);
    return json;
}

}  // namespace stymo
