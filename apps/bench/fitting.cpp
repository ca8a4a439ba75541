#include "apps/bench/fitting.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "apps/bench/study.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "fit/evaluation.h"
#include "fit/fitter.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"
#include "train/data/dataset.h"

namespace stymo {

namespace {

constexpr std::int64_t paper_steps = 200;
constexpr int most_faces = 3;
/// A loss up to this factor of the paper's counts as equal, since left-out samples may cause such a
/// difference.
constexpr double same_loss = 1.005;

/// A variant of fitting, by its differences from the paper's.
struct FitWay {
    std::string name;
    std::string what;
    FitOptions options;
    double perceptual_weight = 0.0;
    std::int64_t perceptual_resolution = 0;
};

/// One variant on one face.
struct FitCurve {
    std::vector<FitPoint> points;
    double seconds = 0.0;
    std::int64_t steps = 0;
};

ReconstructionConfig paper_loss(const StudyInputs& inputs, ReconstructionConfig config) {
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
std::vector<FitWay> fit_ways(const ModelConfig& model, double weight, std::int64_t steps) {
    const std::int64_t half = model.decoder.resolution / 2;
    const std::string halved = "images of " + std::to_string(half) + " pixels in LPIPS";
    const FitOptions adam{.steps = steps};
    FitOptions every = adam, coarse = adam, lbfgs = adam;
    every.tolerance = 0.0;
    coarse.coarse_steps = steps / 2;
    lbfgs.optimizer = FitOptimizer::lbfgs;
    FitOptions coarse_lbfgs = lbfgs;
    coarse_lbfgs.coarse_steps = steps / 4;
    std::vector<FitWay> ways{
        {"Adam, every sample", "the paper's", every, weight, 0},
        {"Adam", "skips samples of little weight, as all that follow", adam, weight, 0},
        {"Adam, LPIPS at half", halved, adam, weight, half},
        {"Adam, no LPIPS", "photometric alone", adam, 0.0, 0},
        {"L-BFGS", "another optimiser, as many evaluations", lbfgs, weight, 0},
        {"L-BFGS, LPIPS at half", halved, lbfgs, weight, half},
        {"L-BFGS, no LPIPS", "photometric alone", lbfgs, 0.0, 0}};
    // With a single image there is nothing coarser.
    constexpr std::int64_t smallest = 64;
    if (model.decoder.resolution > smallest) {
        ways.push_back({"Adam, coarse to fine", "smaller images in the first half of the steps",
                        coarse, weight, 0});
        ways.push_back({"L-BFGS, coarse to fine", "smaller images in the first quarter",
                        coarse_lbfgs, weight, 0});
    }
    return ways;
}

/// A face with the paper's loss, by which all variants are compared.
class FaceToFit {
public:
    FaceToFit(const Model& model, const ReconstructionLoss& loss, Face face)
        : model_(model),
          loss_(loss),
          batch_(make_batch(std::span(&face, 1))),
          target_{batch_.input, batch_.targets, batch_.cameras},
          kept_(loss.kept_target(target_.targets)),
          measured_(display_image(target_.targets.back(), 0), display_mask(batch_.mask, 0)) {}

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
                             static_cast<double>(step.steps) >=
                                 growth * static_cast<double>(snapshots.back().steps);
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
        const Decoded decoded = model_.decoder()(codes, target_.cameras,
                                                 {.samples_per_ray = config.fit_samples_per_ray});
        Codes offsets;
        for (std::size_t group = 0; group < code_names.size(); ++group)
            offsets.groups[group] = codes.groups[group] - initial.groups[group];
        const Variable total =
            loss_(decoded.images, kept_).total + squared_length(offsets) * config.fit_regularizer;
        return {.loss = total.value().item(),
                .psnr = measured_.measure(display_image(decoded.images.back().value(), 0)).psnr};
    }

    const Model& model_;
    const ReconstructionLoss& loss_;
    FaceBatch batch_;
    FaceBatch target_;
    ReconstructionLoss::Target kept_;
    MetricTarget measured_;
};

/// The last ones of the folder, which trainings hold out.
std::vector<Face> last_faces(const StudyInputs& inputs, const Model& model) {
    const ModelConfig& config = model.config();
    const Dataset data(inputs.fitting.data, config.decoder.resolution, {.cache_megabytes = 0},
                       Split::all, frontal_pose(config.camera));
    const auto count = std::min<std::int64_t>({data.size(), inputs.fitting.faces, most_faces});
    std::vector<Face> faces;
    for (std::int64_t i = data.size() - count; i < data.size(); ++i) faces.push_back(data.load(i));
    return faces;
}

/// When a variant reached, on each face, the final loss of the paper's variant.
struct Arrival {
    std::int64_t faces = 0;
    double steps = 0.0;    ///< mean
    double seconds = 0.0;  ///< mean
    double sooner = 0.0;   ///< the paper's seconds over its own
};

Arrival arrival_of(const std::vector<FitCurve>& curves, const std::vector<FitCurve>& paper) {
    Arrival arrival;
    double paper_seconds = 0.0;
    for (std::size_t face = 0; face < curves.size(); ++face) {
        const FitPoint* point =
            first_reaching(curves[face].points, same_loss * paper[face].points.back().loss);
        if (point == nullptr) continue;
        ++arrival.faces;
        arrival.steps += static_cast<double>(point->steps);
        arrival.seconds += point->seconds;
        paper_seconds += paper[face].seconds;
    }
    if (arrival.faces == 0) return arrival;
    arrival.sooner = paper_seconds / arrival.seconds;
    arrival.steps /= static_cast<double>(arrival.faces);
    arrival.seconds /= static_cast<double>(arrival.faces);
    return arrival;
}

template <class Number>
double mean_of(const std::vector<FitCurve>& curves, const Number& number) {
    double sum = 0.0;
    for (const FitCurve& curve : curves) sum += static_cast<double>(number(curve));
    return sum / static_cast<double>(curves.size());
}

double mean_at(const std::vector<FitCurve>& curves, double seconds, double FitPoint::*number) {
    return mean_of(curves,
                   [&](const FitCurve& curve) { return point_at(curve.points, seconds).*number; });
}

std::vector<Column> summary_columns() {
    return {{"way", "way"},
            {"what", "what"},
            {"seconds_per_step", "ms a step", milliseconds},
            {"seconds", "seconds", fixed<2>},
            {"loss", "loss at the end", fixed<4>},
            {"psnr_db", "PSNR dB", fixed<2>},
            {"faces_there", "faces that get there"},
            {"steps_there", "steps", fixed<0>},
            {"seconds_there", "seconds", fixed<2>},
            {"times_sooner", "times sooner", fixed<1>}};
}

/// The results of a variant compared with the paper's: `summary_columns` from the third on.
Row summary(const std::vector<FitCurve>& curves, const std::vector<FitCurve>& paper) {
    const double seconds = mean_of(curves, [](const FitCurve& curve) { return curve.seconds; });
    const double steps = mean_of(curves, [](const FitCurve& curve) { return curve.steps; });
    const Arrival arrival = arrival_of(curves, paper);
    Row row{seconds / steps, seconds, mean_at(curves, INFINITY, &FitPoint::loss),
            mean_at(curves, INFINITY, &FitPoint::psnr), arrival.faces};
    for (const double number : {arrival.steps, arrival.seconds, arrival.sooner})
        row.push_back(arrival.faces == 0 ? Value("never") : Value(number));
    return row;
}

void add_points(Table& points, const std::string& way, const std::vector<FitCurve>& curves) {
    for (std::size_t face = 0; face < curves.size(); ++face)
        for (const FitPoint& point : curves[face].points)
            points.rows.push_back({way, static_cast<std::int64_t>(face), point.steps, point.seconds,
                                   point.loss, point.psnr});
}

/// The means over the faces, at times that are spread evenly on a logarithmic scale.
void add_means(Table& means, const std::string& way, const std::vector<FitCurve>& curves) {
    const double last = mean_of(curves, [](const FitCurve& curve) { return curve.seconds; });
    double first = last;
    for (const FitCurve& curve : curves) first = std::min(first, curve.points.at(1).seconds);
    constexpr int points = 32;
    for (int i = 0; i <= points; ++i) {
        const double seconds = first * std::pow(last / first, static_cast<double>(i) / points);
        means.rows.push_back({way, seconds, mean_at(curves, seconds, &FitPoint::loss),
                              mean_at(curves, seconds, &FitPoint::psnr)});
    }
}

void write_fitting(Page& page, const StudyInputs& inputs) {
    const InterruptGuard guard;
    const Model model = Model::load(inputs.fitting.model);
    const ReconstructionConfig paper = paper_loss(inputs, model.config().reconstruction);
    const ReconstructionLoss loss(paper);
    std::vector<FaceToFit> faces;
    for (Face& face : last_faces(inputs, model)) faces.emplace_back(model, loss, std::move(face));
    const auto ways_of = [&](std::int64_t steps) {
        return fit_ways(model.config(), paper.perceptual_weight, steps);
    };
    // First as many steps, up to the paper's number, and then as many faces as the time allows. The
    // other variants take less time than the paper's, which leaves time for the evaluation.
    constexpr std::int64_t probe_steps = 4;
    const double steps_in_time = inputs.seconds * static_cast<double>(probe_steps) /
                                 (faces.front().fit(ways_of(probe_steps).front(), paper).seconds *
                                  static_cast<double>(ways_of(1).size()));
    const auto steps =
        static_cast<std::int64_t>(std::clamp(steps_in_time, 8.0, static_cast<double>(paper_steps)));
    const double faces_in_time = std::max(1.0, steps_in_time / static_cast<double>(steps));
    while (static_cast<double>(faces.size()) > faces_in_time) faces.pop_back();

    Table points{.name = "fitting_curves",
                 .columns = {{"way"}, {"face"}, {"steps"}, {"seconds"}, {"loss"}, {"psnr_db"}}};
    Table means{.name = "fitting_means", .columns = {{"way"}, {"seconds"}, {"loss"}, {"psnr_db"}}};
    std::vector<FitCurve> papers_curves;
    std::vector<StudyRow> rows;
    for (const FitWay& way : ways_of(steps))
        rows.push_back({{way.name, way.what}, [&, way] {
                            std::vector<FitCurve> curves;
                            for (const FaceToFit& face : faces)
                                curves.push_back(face.fit(way, paper));
                            if (papers_curves.empty()) papers_curves = curves;
                            add_points(points, way.name, curves);
                            add_means(means, way.name, curves);
                            return summary(curves, papers_curves);
                        }});
    const Table ways = run_study({.name = "fitting", .columns = summary_columns()}, rows);

    const DecoderConfig& decoder = model.config().decoder;
    page.text("The model: " + std::to_string(decoder.resolution) + " pixels, a field of " +
              std::to_string(decoder.field_layers) + " layers of " +
              std::to_string(decoder.field_width) + ". Faces: the last " +
              std::to_string(faces.size()) + " of the folder, one at a time, " +
              std::to_string(steps) +
              " steps each; a step is one evaluation of loss and gradient. L-BFGS ends earlier "
              "where it finds no lower loss.");
    page.text(
        "Whatever a way minimises, its codes are judged by the paper's loss: every sample, "
        "L1 and LPIPS (" +
        loss.lpips()->label() + ", weight " + plain(paper.perceptual_weight) +
        ") at full size, and " + plain(paper.fit_regularizer) +
        " times the squared offsets. Judging does not count as time. The last columns say "
        "when a way comes within half a percent of the loss that the paper's way ends with.");
    const auto plot = [&](const char* name, const char* title, const char* label, const char* key) {
        page.plot(name, plot_of(means, {.series = "way", .x = "seconds", .y = key},
                                {.title = title,
                                 .x_label = "seconds of fitting",
                                 .y_label = label,
                                 .series = {},
                                 .y_scale = PlotScale::linear}));
    };
    plot("fitting_loss", "Loss against seconds of fitting", "the paper's loss", "loss");
    plot("fitting_psnr", "PSNR against seconds of fitting", "PSNR against the photo, dB",
         "psnr_db");
    page.add(ways);
    page.add(points);
}

}  // namespace

const FitPoint* first_reaching(const std::vector<FitPoint>& points, double loss) {
    const auto found =
        std::ranges::find_if(points, [=](const FitPoint& point) { return point.loss <= loss; });
    return found == points.end() ? nullptr : &*found;
}

const FitPoint& point_at(const std::vector<FitPoint>& points, double seconds) {
    const auto later = std::ranges::find_if(
        points, [=](const FitPoint& point) { return point.seconds > seconds; });
    return later == points.begin() ? points.front() : *std::prev(later);
}

Study fitting_study() {
    return {.name = "fitting",
            .title = "Fitting",
            .seconds = 220.0,
            .needs_model = true,
            .write = write_fitting};
}

}  // namespace stymo
