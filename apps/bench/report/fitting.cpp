#include "apps/bench/report/fitting.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "apps/bench/report.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "fit/evaluation.h"
#include "fit/fitter.h"
#include "nn/models/picture.h"
#include "nn/models/view.h"
#include "train/dataset.h"

namespace stymo {

namespace {

constexpr std::int64_t paper_steps = 200;
constexpr int most_faces = 3;
/// A loss this near to the paper's counts as the same: samples that are left out may cost as much.
constexpr double same_loss = 1.005;

/// A way of fitting, by what it does otherwise than the paper.
struct FitWay {
    std::string name;
    std::string what;
    FitOptions options;
    double perceptual_weight = 0.0;
    std::int64_t perceptual_resolution = 0;
};

/// One way on one face.
struct FitCurve {
    std::vector<FitPoint> points;
    double seconds = 0.0;
    std::int64_t steps = 0;
};

ReconstructionConfig paper_loss(const ReportInputs& inputs, ReconstructionConfig config) {
    constexpr double paper_weight = 0.1;
    if (config.perceptual_weight == 0.0) config.perceptual_weight = paper_weight;
    config.perceptual_resolution = 0;
    const auto choose = [](std::string& file, const std::string& given) {
        if (!given.empty()) file = given;
        if (file.empty()) file = "random";
    };
    choose(config.perceptual.trunk, inputs.lpips.trunk);
    choose(config.perceptual.heads, inputs.lpips.heads);
    return config;
}

/// The paper's first.
std::vector<FitWay> fit_ways(const ModelConfig& model, double perceptual_weight, std::int64_t steps) {
    const std::int64_t half = model.decoder.resolution / 2;
    const std::string half_side = std::to_string(half) + " pixels";
    const FitOptions every{.steps = steps, .tolerance = 0.0};
    const FitOptions adam{.steps = steps};
    FitOptions coarse = adam;
    coarse.coarse_steps = steps / 2;
    FitOptions lbfgs = adam;
    lbfgs.optimizer = FitOptimizer::lbfgs;
    FitOptions coarse_lbfgs = lbfgs;
    coarse_lbfgs.coarse_steps = steps / 4;
    std::vector<FitWay> ways{{"Adam, every sample", "the paper's", every, perceptual_weight, 0},
                             {"Adam", "without samples that hardly count, as all that follow", adam, perceptual_weight, 0},
                             {"Adam, LPIPS at half", "pictures of " + half_side + " in LPIPS", adam, perceptual_weight, half},
                             {"Adam, no LPIPS", "photometric alone", adam, 0.0, 0},
                             {"L-BFGS", "another optimiser, as many evaluations", lbfgs, perceptual_weight, 0},
                             {"L-BFGS, LPIPS at half", "pictures of " + half_side + " in LPIPS", lbfgs, perceptual_weight, half},
                             {"L-BFGS, no LPIPS", "photometric alone", lbfgs, 0.0, 0}};
    // With a single picture there is nothing coarser.
    constexpr std::int64_t smallest = 64;
    if (model.decoder.resolution > smallest) {
        ways.push_back({"Adam, coarse to fine", "smaller pictures in the first half of the steps", coarse, perceptual_weight, 0});
        ways.push_back({"L-BFGS, coarse to fine", "smaller pictures in the first quarter", coarse_lbfgs, perceptual_weight, 0});
    }
    return ways;
}

/// A face with the paper's loss, which all ways are judged by.
class FaceToFit {
public:
    FaceToFit(const Model& model, const ReconstructionLoss& loss, Face face)
        : model_(model),
          loss_(loss),
          batch_(make_batch(std::span(&face, 1))),
          target_{batch_.input, batch_.targets, batch_.cameras},
          kept_(loss.kept_target(target_.targets)),
          measured_(picture(target_.targets.back(), 0), picture_mask(batch_.mask, 0)) {}

    [[nodiscard]] FitCurve fit(const FitWay& way, const ReconstructionConfig& paper) const {
        ReconstructionConfig config = paper;
        config.perceptual_weight = way.perceptual_weight;
        config.perceptual_resolution = way.perceptual_resolution;
        const ReconstructionLoss loss(config);
        struct Snapshot {
            std::int64_t steps = 0;
            double seconds = 0.0;
            Codes codes;
        };
        std::vector<Snapshot> snapshots;
        FitCurve curve;
        FitOptions options = way.options;
        const double begin = seconds_now();
        options.on_step = [&](const FitStep& step) {
            constexpr double growth = 1.05;
            const bool due = snapshots.empty() || step.steps >= options.steps ||
                             static_cast<double>(step.steps) >= growth * static_cast<double>(snapshots.back().steps);
            if (due) snapshots.push_back({step.steps, seconds_now() - begin, step.codes});
        };
        const FitResult result = fit_codes(model_, loss, target_, options);
        curve.seconds = seconds_now() - begin;
        curve.steps = std::ssize(result.losses);
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        curve.points.push_back(judged(result.initial, result.initial));
        for (const Snapshot& snapshot : snapshots) {
            FitPoint point = judged(result.initial, snapshot.codes);
            point.steps = snapshot.steps;
            point.seconds = snapshot.seconds;
            curve.points.push_back(point);
        }
        return curve;
    }

private:
    [[nodiscard]] FitPoint judged(const Codes& initial, const Codes& codes) const {
        const ReconstructionConfig& config = model_.config().reconstruction;
        const Decoded decoded = model_.decoder()(codes, target_.cameras, {.samples_per_ray = config.fit_samples_per_ray});
        Codes offsets;
        for (std::size_t group = 0; group < code_names.size(); ++group)
            offsets.groups[group] = codes.groups[group] - initial.groups[group];
        const Variable total = loss_(decoded.images, kept_).total + squared_length(offsets) * config.fit_regularizer;
        return {.loss = total.value().item(), .psnr = measured_.measure(picture(decoded.images.back().value(), 0)).psnr};
    }

    const Model& model_;
    const ReconstructionLoss& loss_;
    TrainingBatch batch_;
    FitTarget target_;
    ReconstructionLoss::Target kept_;
    MetricTarget measured_;
};

/// The last ones of the folder, which trainings hold out.
std::vector<Face> last_faces(const ReportInputs& inputs, const Model& model) {
    const ModelConfig& config = model.config();
    const Dataset data(inputs.fitting.data, config.decoder.resolution, {.cache_megabytes = 0}, Split::all,
                       frontal_pose(config.camera));
    const std::int64_t count = std::min<std::int64_t>({data.size(), inputs.fitting.faces, most_faces});
    std::vector<Face> faces;
    for (std::int64_t i = data.size() - count; i < data.size(); ++i) faces.push_back(data.load(i));
    return faces;
}

struct FittingStudy {
    std::vector<FitWay> ways;
    std::vector<std::vector<FitCurve>> curves;  ///< of each way, one for each face
    std::int64_t steps = paper_steps;
};

/// As many steps, up to the paper's, and then as many faces as there is time for.
FittingStudy measured(const ReportInputs& inputs, const Model& model, const ReconstructionConfig& paper) {
    const ReconstructionLoss loss(paper);
    std::vector<FaceToFit> faces;
    for (Face& face : last_faces(inputs, model)) faces.emplace_back(model, loss, std::move(face));
    const auto ways_for = [&](std::int64_t steps) { return fit_ways(model.config(), paper.perceptual_weight, steps); };
    constexpr std::int64_t probe_steps = 4;
    const double probe = faces.front().fit(ways_for(probe_steps).front(), paper).seconds / static_cast<double>(probe_steps);
    FittingStudy study;
    // The other ways take less time a step than the paper's, and what they save goes to judging.
    const double steps_there_are = inputs.seconds / (probe * static_cast<double>(ways_for(1).size()));
    study.steps = static_cast<std::int64_t>(std::clamp(steps_there_are, 8.0, static_cast<double>(paper_steps)));
    study.ways = ways_for(study.steps);
    study.curves.resize(study.ways.size());
    const double begin = seconds_now();
    for (std::size_t face = 0; face < faces.size(); ++face) {
        const double spent = seconds_now() - begin;
        if (face > 0 && spent * static_cast<double>(face + 1) / static_cast<double>(face) > inputs.seconds) break;
        for (std::size_t way = 0; way < study.ways.size(); ++way)
            study.curves[way].push_back(faces[face].fit(study.ways[way], paper));
    }
    return study;
}

/// The mean over the faces of a number at a time.
double mean_at(const std::vector<FitCurve>& curves, double seconds, double FitPoint::*number) {
    double sum = 0.0;
    for (const FitCurve& curve : curves) sum += point_at(curve.points, seconds).*number;
    return sum / static_cast<double>(curves.size());
}

double mean_seconds(const std::vector<FitCurve>& curves) {
    double sum = 0.0;
    for (const FitCurve& curve : curves) sum += curve.seconds;
    return sum / static_cast<double>(curves.size());
}

double mean_steps(const std::vector<FitCurve>& curves) {
    double sum = 0.0;
    for (const FitCurve& curve : curves) sum += static_cast<double>(curve.steps);
    return sum / static_cast<double>(curves.size());
}

Plot plot_of(const FittingStudy& study, const std::string& title, const std::string& label, PlotScale scale,
             double FitPoint::*number) {
    Plot plot{.title = title, .x_label = "seconds of fitting", .y_label = label, .series = {}, .y_scale = scale};
    for (std::size_t way = 0; way < study.ways.size(); ++way) {
        PlotSeries series{study.ways[way].name, {}, way};
        const double last = mean_seconds(study.curves[way]);
        double first = last;
        for (const FitCurve& curve : study.curves[way]) first = std::min(first, curve.points.at(1).seconds);
        constexpr int points = 32;
        for (int i = 0; i <= points; ++i) {
            const double seconds = first * std::pow(last / first, static_cast<double>(i) / points);
            series.points.push_back({seconds, mean_at(study.curves[way], seconds, number), ""});
        }
        plot.series.push_back(std::move(series));
    }
    return plot;
}

/// When a way had reached on each face what the paper's has there at its end.
struct Arrival {
    int faces = 0;
    double steps = 0.0;    ///< mean
    double seconds = 0.0;  ///< mean
    double sooner = 0.0;   ///< the paper's seconds over its own
};

Arrival arrival_of(const FittingStudy& study, std::size_t way) {
    Arrival arrival;
    double paper_seconds = 0.0;
    for (std::size_t face = 0; face < study.curves[way].size(); ++face) {
        const FitCurve& paper = study.curves.front()[face];
        const FitPoint* point = first_reaching(study.curves[way][face].points, same_loss * paper.points.back().loss);
        if (point == nullptr) continue;
        ++arrival.faces;
        arrival.steps += static_cast<double>(point->steps);
        arrival.seconds += point->seconds;
        paper_seconds += paper.seconds;
    }
    if (arrival.faces == 0) return arrival;
    arrival.sooner = paper_seconds / arrival.seconds;
    arrival.steps /= arrival.faces;
    arrival.seconds /= arrival.faces;
    return arrival;
}

void write_ways(ReportWriter& report, const FittingStudy& study) {
    std::vector<std::vector<ReportCell>> rows, points;
    for (std::size_t way = 0; way < study.ways.size(); ++way) {
        const std::vector<FitCurve>& curves = study.curves[way];
        const double seconds = mean_seconds(curves), step = seconds / mean_steps(curves);
        const double loss = mean_at(curves, 1e9, &FitPoint::loss), psnr = mean_at(curves, 1e9, &FitPoint::psnr);
        const Arrival arrival = arrival_of(study, way);
        const auto faces = static_cast<int>(curves.size());
        const std::string some =
            arrival.faces == faces ? "" : " (" + std::to_string(arrival.faces) + " of " + std::to_string(faces) + " faces)";
        const auto when = [&](double number, int digits) -> ReportCell {
            if (arrival.faces == 0) return {"never", JsonValue()};
            return {decimal(number, digits) + some, number};
        };
        rows.push_back({study.ways[way].name,
                        study.ways[way].what,
                        {decimal(step * 1e3, 1), step},
                        {decimal(seconds, 2), seconds},
                        {decimal(loss, 4), loss},
                        {decimal(psnr, 2), psnr},
                        when(arrival.steps, 0),
                        when(arrival.seconds, 2),
                        when(arrival.sooner, 1)});
        for (std::size_t face = 0; face < curves.size(); ++face)
            for (const FitPoint& point : curves[face].points)
                points.push_back({study.ways[way].name, face, point.steps, point.seconds, point.loss, point.psnr});
    }
    report.table("fitting",
                 {"way", "what", "ms a step", "seconds", "loss at the end", "PSNR dB", "steps to the paper's loss", "seconds",
                  "times sooner"},
                 rows);
    report.data("fitting_curves", {"way", "face", "steps", "seconds", "loss", "psnr_db"}, points);
}

void write_fitting(ReportWriter& report, const ReportInputs& inputs) {
    const InterruptGuard guard;
    const Model model = Model::load(inputs.fitting.model);
    const ReconstructionConfig paper = paper_loss(inputs, model.config().reconstruction);
    const FittingStudy study = measured(inputs, model, paper);
    const ReconstructionLoss loss(paper);
    const DecoderConfig& decoder = model.config().decoder;
    report.text(
        "The model: " + std::to_string(decoder.resolution) + " pixels, a field of " + std::to_string(decoder.field_layers) +
        " layers of " + std::to_string(decoder.field_width) + ". Faces: the last of the folder, " +
        std::to_string(study.curves.front().size()) + ", one at a time, " + std::to_string(study.steps) +
        " steps each; a step is one evaluation of loss and gradient. L-BFGS may end before that, where it finds nothing lower.");
    report.text("Whatever a way minimises, its codes are judged by the paper's loss: every sample, L1 and LPIPS (" +
                loss.lpips()->label() + ", weight " + ReportCell(paper.perceptual_weight).text + ") at full size, and " +
                ReportCell(paper.fit_regularizer).text +
                " times the squared offsets. Judging does not count as time. Curves are means over the faces. \"To the paper's "
                "loss\": to within "
                "half a percent of what the paper's way has on that face at its end.");
    report.plot("fitting_loss",
                plot_of(study, "Loss against seconds of fitting", "the paper's loss", PlotScale::linear, &FitPoint::loss));
    report.plot("fitting_psnr", plot_of(study, "PSNR against seconds of fitting", "PSNR against the photo, dB", PlotScale::linear,
                                        &FitPoint::psnr));
    write_ways(report, study);
}

}  // namespace

const FitPoint* first_reaching(const std::vector<FitPoint>& points, double loss) {
    const auto found = std::ranges::find_if(points, [=](const FitPoint& point) { return point.loss <= loss; });
    return found == points.end() ? nullptr : &*found;
}

const FitPoint& point_at(const std::vector<FitPoint>& points, double seconds) {
    const auto later = std::ranges::find_if(points, [=](const FitPoint& point) { return point.seconds > seconds; });
    return later == points.begin() ? points.front() : *std::prev(later);
}

ReportSection fitting_section() {
    constexpr double seconds = 220.0;
    return {.name = "fitting", .title = "Fitting", .seconds = seconds, .needs_model = true, .write = write_fitting};
}

}  // namespace stymo
