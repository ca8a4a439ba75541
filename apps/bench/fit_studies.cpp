#include <algorithm>
#include <cmath>
#include <memory>
#include <span>

#include "apps/bench/study.h"
#include "core/angle.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/matmul_precision.h"
#include "core/ops/ops.h"
#include "fit/evaluation.h"
#include "fit/fit_report.h"
#include "fit/fitter.h"
#include "fit/tuning.h"
#include "nn/models/display_image.h"
#include "nn/models/significant_rows.h"
#include "nn/realtime/view.h"

/// Studies of fits: loss against time, and what leaving out samples does to a gradient.
namespace stymo {

namespace {

constexpr std::int64_t paper_steps = 200;
constexpr std::int64_t most_faces = 3;
/// A loss up to this factor of the paper's counts as equal, since left-out samples may cause such a
/// difference.
constexpr double same_loss = 1.005;

/// A photo whose codes are fitted.
struct FitTarget {
    explicit FitTarget(const Face& face) : FitTarget(make_batch(std::span(&face, 1))) {}
    explicit FitTarget(const FaceBatch& batch)
        : faces{.input = batch.input,
                .targets = batch.targets,
                .cameras = batch.cameras,
                .known = batch.known},
          measured(display_image(batch.targets.back(), 0), display_mask(batch.mask, 0), nullptr,
                   known_in(batch, 0)) {}

    FaceBatch faces;
    MetricTarget measured;
};

/// The loss of the paper's fitting, by which all variants are judged.
ReconstructionConfig paper_loss(const StudyInputs& inputs, ReconstructionConfig config) {
    constexpr double paper_weight = 0.1;
    const bool by_encoder = config.perceptual.network == encoder_network;
    if (by_encoder) config.perceptual.network = "squeezenet1_1";
    if (by_encoder || config.perceptual_weight == 0.0) config.perceptual_weight = paper_weight;
    config.perceptual_resolution = 0;
    const auto choose = [](std::string& file, const std::string& given) {
        if (!given.empty()) file = given;
        if (file.empty()) file = "random";
    };
    choose(config.perceptual.trunk, inputs.lpips.trunk);
    choose(config.perceptual.heads, inputs.lpips.heads);
    return config;
}

/// A variant of fitting, by its differences from the paper's.
struct FitVariant {
    std::string name;
    std::string what;
    FitOptions options;
    double perceptual_weight = 0.0;
    std::int64_t perceptual_resolution = 0;
    MatmulPrecision precision = MatmulPrecision::highest;
    bool by_encoder = false;  ///< the perceptual term compares activations of the model's encoder
};

/// The paper's first.
std::vector<FitVariant> fit_variants(const ModelConfig& model, double weight, std::int64_t steps) {
    const std::int64_t half = model.decoder.resolution / 2;
    const std::string halved = "images of " + std::to_string(half) + " pixels in LPIPS";
    const FitOptions adam{.steps = steps};
    FitOptions every = adam, coarse = adam, lbfgs = adam;
    every.tolerance = 0.0;
    coarse.coarse_steps = steps / 2;
    lbfgs.optimizer = FitOptimizer::lbfgs;
    FitOptions short_lbfgs = lbfgs, half_samples = lbfgs, double_samples = lbfgs;
    short_lbfgs.steps = std::max<std::int64_t>(steps * 3 / 10, 1);
    half_samples.samples_per_ray =
        std::max<std::int64_t>(model.reconstruction.fit_samples_per_ray / 2, 2);
    double_samples.samples_per_ray = 2 * model.reconstruction.fit_samples_per_ray;
    FitOptions coarse_lbfgs = lbfgs;
    coarse_lbfgs.coarse_steps = steps / 4;
    std::vector<FitVariant> variants{
        {"Adam, every sample", "the paper's", every, weight, 0},
        {"Adam", "skips samples of little weight, as all that follow", adam, weight, 0},
        {"Adam, LPIPS at half", halved, adam, weight, half},
        {"Adam, no LPIPS", "photometric alone", adam, 0.0, 0},
        {"L-BFGS", "another optimiser, as many evaluations", lbfgs, weight, 0},
        {"L-BFGS, few steps", "three tenths of the evaluations", short_lbfgs, weight, 0},
        {"L-BFGS, half the samples", "along each ray", half_samples, weight, 0},
        {"L-BFGS, twice the samples", "along each ray", double_samples, weight, 0},
        {"L-BFGS, LPIPS at half", halved, lbfgs, weight, half},
        {"L-BFGS, no LPIPS", "photometric alone", lbfgs, 0.0, 0},
        {"Adam, coarse to fine", "smaller images in the first half of the steps", coarse, weight,
         0},
        {"L-BFGS, coarse to fine", "smaller images in the first quarter", coarse_lbfgs, weight, 0}};
    if (model.reconstruction.perceptual.network == encoder_network)
        variants.push_back({.name = "L-BFGS, encoder",
                            .what = "the model's own perceptual term",
                            .options = lbfgs,
                            .perceptual_weight = model.reconstruction.perceptual_weight,
                            .by_encoder = true});
    for (const auto precision : {MatmulPrecision::high, MatmulPrecision::medium})
        if (computed_precision(precision) == precision)
            variants.push_back({std::string("L-BFGS, ") + name_of(precision),
                                "precision of products", lbfgs, weight, 0, precision});
    // With a single image there is nothing coarser.
    constexpr std::int64_t smallest = 64;
    if (model.decoder.resolution <= smallest)
        std::erase_if(variants, [](const FitVariant& one) { return one.options.coarse_steps > 0; });
    return variants;
}

/// The state of a fit after some steps.
struct FitPoint {
    std::int64_t steps = 0;
    double seconds = 0.0;
    double loss = 0.0;  ///< the paper's
    double psnr = 0.0;
};

/// One variant on one face.
struct FitCurve {
    std::vector<FitPoint> points;
    double seconds = 0.0;
    std::int64_t steps = 0;
};

/// A model, and the loss by which its fits are judged.
struct Judge {
    Judge(Model judged, const ReconstructionConfig& config)
        : model(std::move(judged)), paper(config), loss(config) {}

    Model model;
    ReconstructionConfig paper;
    ReconstructionLoss loss;
};

/// Loss and PSNR of codes at every sample. `kept`: the target of the paper's loss.
FitPoint judged(const Judge& judge, const FitTarget& photo, const ReconstructionLoss::Target& kept,
                const Codes& initial, const Codes& codes) {
    const ReconstructionConfig& config = judge.model.config().reconstruction;
    const Decoded decoded = judge.model.decoder()(codes, photo.faces.cameras,
                                                  {.samples_per_ray = config.fit_samples_per_ray});
    Codes offsets;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        offsets.groups[group] = codes.groups[group] - initial.groups[group];
    const Variable total =
        judge.loss(decoded.images, kept).total + squared_length(offsets) * config.fit_regularizer;
    const Tensor image = display_image(decoded.images.back().value(), 0);
    return {.loss = total.value().item(), .psnr = photo.measured.measure(image).psnr};
}

/// Judging does not count as time of the fit.
FitCurve fitted(const Judge& judge, const FitTarget& photo, const FitVariant& variant) {
    ReconstructionConfig config = judge.paper;
    config.perceptual_weight = variant.perceptual_weight;
    config.perceptual_resolution = variant.perceptual_resolution;
    if (variant.by_encoder) config.perceptual.network = encoder_network;
    const ReconstructionLoss loss(config, "",
                                  variant.by_encoder ? &judge.model.encoder() : nullptr);
    const ReconstructionLoss::Target kept =
        judge.loss.kept_target(photo.faces.targets, photo.faces.known);
    FitOptions options = variant.options;
    options.initial = detached(face_codes(judge.model, photo.faces));
    FitCurve curve{{judged(judge, photo, kept, *options.initial, *options.initial)}};
    double begin = seconds_now();
    options.on_step = [&](const FitStep& step) {
        constexpr double growth = 1.05;
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const double seconds = seconds_now() - begin;
        if (step.steps < options.steps && curve.points.size() > 1 &&
            static_cast<double>(step.steps) <
                growth * static_cast<double>(curve.points.back().steps))
            return;
        const PrecisionScope every_bit(MatmulPrecision::highest);
        FitPoint point = judged(judge, photo, kept, *options.initial, step.codes);
        point.steps = step.steps;
        point.seconds = seconds;
        curve.points.push_back(point);
        begin = seconds_now() - seconds;
    };
    const PrecisionScope scope(variant.precision);
    curve.steps = std::ssize(fit_codes(judge.model, loss, photo.faces, options).losses);
    curve.seconds = seconds_now() - begin;
    return curve;
}

template <class Number>
double mean_of(const std::vector<FitCurve>& curves, const Number& number) {
    double sum = 0.0;
    for (const FitCurve& curve : curves) sum += static_cast<double>(number(curve));
    return sum / static_cast<double>(curves.size());
}

/// The results of a variant: its means, and when it reached, on each face, the final loss of the
/// paper's variant.
Row fit_summary(const std::vector<FitCurve>& curves, const std::vector<FitCurve>& paper) {
    std::vector<FitCurve> reached;  // up to that loss
    double paper_seconds = 0.0;
    for (std::size_t face = 0; face < curves.size(); ++face) {
        const double wanted = same_loss * paper[face].points.back().loss;
        for (const FitPoint& point : curves[face].points) {
            if (point.loss > wanted) continue;
            reached.push_back({{}, point.seconds, point.steps});
            paper_seconds += paper[face].seconds;
            break;
        }
    }
    const auto seconds = [](const FitCurve& curve) { return curve.seconds; };
    const auto steps = [](const FitCurve& curve) { return curve.steps; };
    Row row{mean_of(curves, seconds) / mean_of(curves, steps), mean_of(curves, seconds),
            mean_of(curves, [](const FitCurve& curve) { return curve.points.back().loss; }),
            mean_of(curves, [](const FitCurve& curve) { return curve.points.back().psnr; }),
            std::ssize(reached)};
    if (reached.empty()) {
        row.insert(row.end(), 3, "never");
    } else {
        const double own = mean_of(reached, seconds);
        row.insert(row.end(), {mean_of(reached, steps), own,
                               paper_seconds / static_cast<double>(reached.size()) / own});
    }
    return row;
}

StudyPlan fitting_plan(const StudyInputs& inputs) {
    Model loaded = Model::load(inputs.fitting.model);
    const ReconstructionConfig paper_config = paper_loss(inputs, loaded.config().reconstruction);
    const auto judge = std::make_shared<const Judge>(std::move(loaded), paper_config);
    const ModelConfig& config = judge->model.config();
    const auto variants_of = [&](std::int64_t steps) {
        return fit_variants(config, judge->paper.perceptual_weight, steps);
    };
    std::vector<FitTarget> photos;
    for (const Face& face : last_photos(inputs.fitting, config,
                                        std::min<std::int64_t>(inputs.fitting.faces, most_faces)))
        photos.emplace_back(face);
    // First as many steps, up to the paper's number, and then as many faces as the time allows. The
    // other variants take less time than the paper's, which leaves time for the evaluation.
    constexpr std::int64_t probe_steps = 4;
    const std::vector<FitVariant> probes = variants_of(probe_steps);
    const double steps_in_time = inputs.seconds * static_cast<double>(probe_steps) /
                                 (fitted(*judge, photos.front(), probes.front()).seconds *
                                  static_cast<double>(probes.size()));
    const auto steps =
        static_cast<std::int64_t>(std::clamp(steps_in_time, 8.0, static_cast<double>(paper_steps)));
    const double faces_in_time = std::max(1.0, steps_in_time / static_cast<double>(steps));
    while (static_cast<double>(photos.size()) > faces_in_time) photos.pop_back();

    StudyPlan plan;
    plan.curves = std::make_shared<Table>(
        Table{"fitting_curves", {"way", "face", "steps", "seconds", "loss", "psnr_db"}});
    const auto paper = std::make_shared<std::vector<FitCurve>>();
    for (const FitVariant& variant : variants_of(steps))
        plan.add({variant.name, variant.what}, [=, points = plan.curves] {
            std::vector<FitCurve> curves;
            for (const FitTarget& photo : photos) curves.push_back(fitted(*judge, photo, variant));
            if (paper->empty()) *paper = curves;
            for (std::size_t face = 0; face < curves.size(); ++face)
                for (const FitPoint& point : curves[face].points)
                    points->rows.push_back({variant.name, static_cast<std::int64_t>(face),
                                            point.steps, point.seconds, point.loss, point.psnr});
            return fit_summary(curves, *paper);
        });
    plan.setting =
        "The model: " + std::to_string(config.decoder.resolution) + " pixels, a field of " +
        std::to_string(config.decoder.field_layers) + " layers of " +
        std::to_string(config.decoder.field_width) + ". Faces: the last " +
        std::to_string(photos.size()) + " of the folder, " + std::to_string(steps) +
        " evaluations of loss and gradient each. LPIPS: " + judge->loss.lpips()->label() +
        ", weight " + significant(judge->paper.perceptual_weight, 3) + ".";
    return plan;
}

/// Tuning of one fitted face for several times, with the steps that the machine does in them.
StudyPlan tuning_plan(const StudyInputs& inputs) {
    constexpr std::int64_t fit_steps = 30;
    Model loaded = Model::load(inputs.fitting.model);
    ReconstructionConfig config = loaded.config().reconstruction;
    config.perceptual_weight = 0.0;  // tuning is then judged by what it lowers
    const auto judge = std::make_shared<const Judge>(std::move(loaded), config);
    const auto photo = std::make_shared<const FitTarget>(
        last_photos(inputs.fitting, judge->model.config(), 1).front());
    const auto fit = std::make_shared<const FitResult>(
        fit_codes(judge->model, judge->loss, photo->faces,
                  {.optimizer = FitOptimizer::lbfgs, .steps = fit_steps}));
    const auto frame = [=](const Model& model, double yaw) {
        Pose pose = pose_from_camera(photo->faces.cameras[0]);
        const CameraConfig& camera = judge->model.config().camera;
        if (yaw != 0.0) pose = pivot_pose(yaw, 0.0, 0.0, camera.distance, camera.pivot_depth);
        return render_view(model, fit->fitted, 0,
                           camera_from_pose(pose, photo->faces.cameras[0].intrinsics),
                           {.samples_per_ray = judge->paper.fit_samples_per_ray})
            .image;
    };
    StudyPlan plan;
    for (const double seconds : {0.0, 1.0, 3.0, 10.0, 30.0}) {
        if (seconds > inputs.seconds / 2.0) continue;
        plan.add({seconds}, [=]() -> Row {
            Model tuned = judge->model.copy();
            std::int64_t steps = 0;
            if (seconds > 0.0)
                steps =
                    std::ssize(tune_decoder(judge->model, tuned, judge->loss, photo->faces,
                                            fit->fitted, photo->faces.cameras, {.seconds = seconds})
                                   .losses);
            const double yaw = radians_from_degrees(30.0);
            return {steps, photo->measured.measure(frame(tuned, 0.0)).psnr,
                    error_of({frame(tuned, yaw)}, {frame(judge->model, yaw)}).psnr_mean};
        });
    }
    plan.setting = "One face, the last of the folder, fitted in " + std::to_string(fit_steps) +
                   " evaluations of L-BFGS, both without LPIPS.";
    return plan;
}

double inner_product(const Tensor& a, const Tensor& b) {
    return sum(Variable(a) * Variable(b)).value().item();
}

/// The gradient of the loss with respect to all codes, in one row. `significant`: the samples that
/// count; undefined: every sample.
Tensor gradient(const Judge& judge, const FitTarget& photo, const Codes& at, std::int64_t samples,
                const Tensor& significant) {
    Codes codes;
    for (std::size_t i = 0; i < codes.groups.size(); ++i)
        codes.groups[i] = Variable::leaf(at.groups[i].value());
    const std::vector<Tensor>& targets = photo.faces.targets;
    const Decoded decoded = judge.model.decoder()(codes, photo.faces.cameras,
                                                  {.samples_per_ray = samples,
                                                   .resolution = targets.back().shape(1),
                                                   .significant_samples = significant});
    const Variable total = judge.loss(decoded.images, judge.loss.target(targets)).total;
    return concat(grad(total, {codes.groups.begin(), codes.groups.end()}), 1).value();
}

/// A face, its fit with every sample, and the PSNR of that.
struct BiasFace {
    FitTarget photo;
    FitResult exact;
    double psnr = 0.0;
};

/// Means and worst values over all faces; gradients are compared at the initial and at the fitted
/// codes. `fit` fits a photo and returns also the PSNR.
Row bias_at(double tolerance, const Judge& judge, const std::vector<BiasFace>& faces,
            std::int64_t samples_per_ray, const auto& fit) {
    double samples = 0.0, cosine_mean = 0.0, cosine_worst = 1.0, distance_mean = 0.0,
           distance_worst = 0.0, psnr_mean = 0.0, psnr_worst_loss = 0.0;
    const auto count = static_cast<double>(faces.size());
    for (const BiasFace& face : faces) {
        const double psnr = tolerance == 0.0 ? face.psnr : fit(face.photo, tolerance).psnr;
        psnr_mean += psnr / count;
        psnr_worst_loss = std::max(psnr_worst_loss, face.psnr - psnr);
        for (const Codes& codes : {face.exact.initial, face.exact.fitted}) {
            const Tensor kept =
                significant_samples(judge.model.decoder().compositing_weights(
                                        codes, face.photo.faces.cameras, samples_per_ray),
                                    tolerance);
            const Tensor every = gradient(judge, face.photo, codes, samples_per_ray, {}),
                         some = gradient(judge, face.photo, codes, samples_per_ray, kept);
            const double length = std::sqrt(inner_product(every, every));
            const double cosine =
                inner_product(every, some) / (length * std::sqrt(inner_product(some, some)));
            const Tensor difference = (Variable(some) - Variable(every)).value();
            const double distance = std::sqrt(inner_product(difference, difference)) / length;
            samples += 0.5 * mean(Variable(kept)).value().item() / count;
            cosine_mean += 0.5 * cosine / count;
            cosine_worst = std::min(cosine_worst, cosine);
            distance_mean += 0.5 * distance / count;
            distance_worst = std::max(distance_worst, distance);
        }
    }
    return {samples,        cosine_mean, cosine_worst,   distance_mean,
            distance_worst, psnr_mean,   psnr_worst_loss};
}

StudyPlan bias_plan(const StudyInputs& inputs) {
    BenchSubject subject = make_subject(inputs.bench);
    ReconstructionConfig photometric = subject.model.config().reconstruction;
    photometric.perceptual_weight = 0.0;
    const auto judge = std::make_shared<const Judge>(std::move(subject.model), photometric);
    const auto fit = [=, bench = inputs.bench](const FitTarget& photo, double tolerance) {
        BiasFace face{photo, fit_codes(judge->model, judge->loss, photo.faces,
                                       {.steps = bench.steps,
                                        .samples_per_ray = bench.samples,
                                        .tolerance = tolerance})};
        const View view = render_view(judge->model, face.exact.fitted, 0, photo.faces.cameras[0],
                                      {.samples_per_ray = judge->paper.fit_samples_per_ray});
        face.psnr = photo.measured.measure(view.image).psnr;
        return face;
    };
    std::vector<BiasFace> faces;
    for (const Face& photo : subject.photos) faces.push_back(fit(FitTarget(photo), 0.0));
    StudyPlan plan;
    for (const double tolerance : {0.0, 1e-4, 1e-3, 1e-2})
        plan.add({tolerance}, [=, samples = inputs.bench.samples] {
            return bias_at(tolerance, *judge, faces, samples, fit);
        });
    return plan;
}

}  // namespace

Study fitting_study() {
    return {.part = "fitting",
            .name = "fitting",
            .title = "Fitting",
            .varied =
                "optimiser, samples along a ray and those left out, LPIPS, smaller images first, "
                "precision of products",
            .measured =
                "time, the paper's loss and PSNR at the end, and when a way comes within "
                "half a percent of the reference's final loss",
            .reference = "the paper's way, Adam with every sample",
            .columns = {"way", "what", "seconds_per_step", "seconds", "loss", "psnr_db",
                        "faces_there", "steps_there", "seconds_there", "times_sooner"},
            .plan = fitting_plan,
            .seconds = 220.0,
            .needs_model = true};
}

Study tuning_study() {
    return {.part = "fitting",
            .name = "tuning",
            .title = "Tuning",
            .varied = "seconds of tuning",
            .measured =
                "steps that were done, PSNR to the photo, and PSNR from a yaw of 30 degrees "
                "between the tuned and the untuned face",
            .reference = "the photo; the untuned face",
            .columns = {"seconds", "steps", "psnr_db", "psnr_turned_db"},
            .plan = tuning_plan,
            .seconds = 70.0,
            .needs_model = true};
}

Study bias_study() {
    return {.part = "bias",
            .name = "bias",
            .title = "Bias of a fit that leaves out samples",
            .varied = "weight below which a sample is left out",
            .measured = "direction and relative difference of the gradient, and PSNR of the fit",
            .reference = "gradient and fit with every sample",
            .columns = {"tolerance", "samples", "cosine_mean", "cosine_worst", "distance_mean",
                        "distance_worst", "psnr_mean_db", "psnr_worst_loss_db"},
            .plan = bias_plan};
}

}  // namespace stymo
