#include <algorithm>
#include <memory>
#include <span>

#include "apps/bench/study.h"
#include "core/angle.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/matmul_precision.h"
#include "core/ops/ops.h"
#include "fit/fit_report.h"
#include "fit/fitter.h"
#include "fit/shipped_files.h"
#include "fit/tuning.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"

/// Studies of fits: loss against time, and tuning.
namespace stymo {

namespace {

constexpr std::int64_t paper_steps = 200;
constexpr std::int64_t most_faces = 3;
/// A loss up to this factor of the paper's counts as equal, since left-out samples may cause such a
/// difference.
constexpr double same_loss = 1.005;

/// A photo whose codes are fitted.
struct FitTarget {
    explicit FitTarget(const FaceBatch& batch)
        : faces(batch),
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
    ReconstructionConfig loss;
    MatmulPrecision precision = MatmulPrecision::highest;
};

/// The paper's first.
std::vector<FitVariant> fit_variants(const ModelConfig& model, const ReconstructionConfig& paper,
                                     std::int64_t steps) {
    const std::int64_t side = model.decoder.resolution;
    const std::int64_t samples = model.reconstruction.fit_samples_per_ray;
    const auto lbfgs = [](FitVariant& fit) { fit.options.optimizer = FitOptimizer::lbfgs; };
    const auto halved = [=](FitVariant& fit) { fit.loss.perceptual_resolution = side / 2; };
    const auto photometric = [](FitVariant& fit) { fit.loss.perceptual_weight = 0.0; };
    const auto with_samples = [](std::int64_t count) {
        return [=](FitVariant& fit) {
            fit.options.samples_per_ray = std::max<std::int64_t>(count, 2);
        };
    };
    const auto coarse = [=](std::int64_t part) {
        return [=](FitVariant& fit) { fit.options.coarse_steps = steps / part; };
    };
    std::vector<FitVariant> variants;
    const auto add = [&](const std::string& name, const std::string& what, auto... edits) {
        FitVariant& next = variants.emplace_back(FitVariant{name, what, {.steps = steps}, paper});
        (edits(next), ...);
    };
    const std::string at_half = "images of " + std::to_string(side / 2) + " pixels in LPIPS";
    add("Adam, every sample", "the paper's", [](FitVariant& fit) { fit.options.tolerance = 0.0; });
    add("Adam", "skips samples of little weight, as all that follow");
    add("Adam, LPIPS at half", at_half, halved);
    add("Adam, no LPIPS", "photometric alone", photometric);
    add("L-BFGS", "another optimiser, as many evaluations", lbfgs);
    add("L-BFGS, few steps", "three tenths of the evaluations", lbfgs,
        [=](FitVariant& fit) { fit.options.steps = std::max<std::int64_t>(steps * 3 / 10, 1); });
    add("L-BFGS, half the samples", "along each ray", lbfgs, with_samples(samples / 2));
    add("L-BFGS, twice the samples", "along each ray", lbfgs, with_samples(2 * samples));
    add("L-BFGS, LPIPS at half", at_half, lbfgs, halved);
    add("L-BFGS, no LPIPS", "photometric alone", lbfgs, photometric);
    // With a single image there is nothing coarser.
    if (constexpr std::int64_t smallest = 64; side > smallest) {
        add("Adam, coarse to fine", "smaller images in the first half of the steps", coarse(2));
        add("L-BFGS, coarse to fine", "smaller images in the first quarter", lbfgs, coarse(4));
    }
    if (model.reconstruction.perceptual.network == encoder_network)
        add("L-BFGS, encoder", "the model's own perceptual term", lbfgs, [&](FitVariant& fit) {
            fit.loss.perceptual_weight = model.reconstruction.perceptual_weight;
            fit.loss.perceptual.network = encoder_network;
        });
    for (const auto precision : {MatmulPrecision::high, MatmulPrecision::medium})
        if (computed_precision(precision) == precision)
            add(std::string("L-BFGS, ") + name_of(precision), "precision of products", lbfgs,
                [=](FitVariant& fit) { fit.precision = precision; });
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
    const ReconstructionLoss loss(variant.loss, "", &judge.model.encoder());
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

/// The results of a variant: its means, and when it reached, on each face, the final loss of the
/// paper's variant.
Row fit_summary(const std::vector<FitCurve>& curves, const std::vector<FitCurve>& paper) {
    const auto faces = static_cast<double>(curves.size());
    double seconds = 0.0, steps = 0.0, loss = 0.0, psnr = 0.0;
    // Of the faces that reached it.
    double steps_there = 0.0, seconds_there = 0.0, paper_seconds = 0.0;
    std::int64_t reached = 0;
    for (std::size_t face = 0; face < curves.size(); ++face) {
        const FitCurve& curve = curves[face];
        seconds += curve.seconds;
        steps += static_cast<double>(curve.steps);
        loss += curve.points.back().loss / faces;
        psnr += curve.points.back().psnr / faces;
        const double wanted = same_loss * paper[face].points.back().loss;
        const auto there = std::ranges::find_if(
            curve.points, [=](const FitPoint& point) { return point.loss <= wanted; });
        if (there == curve.points.end()) continue;
        ++reached;
        steps_there += static_cast<double>(there->steps);
        seconds_there += there->seconds;
        paper_seconds += paper[face].seconds;
    }
    Row row{seconds / steps, seconds / faces, loss, psnr, reached};
    if (reached == 0) {
        row.insert(row.end(), 3, "never");
    } else {
        const auto count = static_cast<double>(reached);
        row.insert(row.end(),
                   {steps_there / count, seconds_there / count, paper_seconds / seconds_there});
    }
    return row;
}

StudyPlan fitting_plan(const StudyInputs& inputs) {
    Model loaded = Model::load(named_model(inputs.fitting.model));
    const ReconstructionConfig paper_config = paper_loss(inputs, loaded.config().reconstruction);
    const auto judge = std::make_shared<const Judge>(std::move(loaded), paper_config);
    const ModelConfig& config = judge->model.config();
    const auto variants_of = [&](std::int64_t steps) {
        return fit_variants(config, judge->paper, steps);
    };
    std::vector<FitTarget> photos;
    for (const Face& face : last_photos(inputs.fitting, config,
                                        std::min<std::int64_t>(inputs.fitting.faces, most_faces)))
        photos.emplace_back(make_batch({&face, 1}, judge->model.decoder().ladder().smallest()));
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
    Model loaded = Model::load(named_model(inputs.fitting.model));
    ReconstructionConfig config = loaded.config().reconstruction;
    config.perceptual_weight = 0.0;  // tuning is then judged by what it lowers
    const auto judge = std::make_shared<const Judge>(std::move(loaded), config);
    const auto photo = std::make_shared<const FitTarget>(
        make_batch(last_photos(inputs.fitting, judge->model.config(), 1),
                   judge->model.decoder().ladder().smallest()));
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

}  // namespace

Study fitting_study() {
    return {.part = "fitting",
            .name = "fitting",
            .title = "Fitting",
            .varied = "optimiser, samples, LPIPS, smaller images first, precision of products",
            .measured = "time, the paper's loss, PSNR; when a way is within 0.5 % of the reference",
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
            .measured = "steps, PSNR to the photo, PSNR between both faces at a yaw of 30 degrees",
            .reference = "the photo; the untuned face",
            .columns = {"seconds", "steps", "psnr_db", "psnr_turned_db"},
            .plan = tuning_plan,
            .seconds = 70.0,
            .needs_model = true};
}

}  // namespace stymo
