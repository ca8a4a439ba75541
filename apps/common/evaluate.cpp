#include "apps/common/evaluate.h"

#include <algorithm>
#include <charconv>
#include <iomanip>
#include <sstream>

#include "apps/common/command_line.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/image.h"
#include "core/ops/resample.h"
#include "core/progress.h"
#include "fit/fit_report.h"
#include "nn/models/view.h"
#include "train/face_codes.h"

namespace stymo {

namespace {

std::int64_t parse_index(std::string_view text, const std::string& whole) {
    std::int64_t value = 0;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || end.ec != std::errc{} || end.ptr != text.data() + text.size() || value < 0) {
        fail<UsageError>("--ids ", whole, ": must be a range of places in the order of ids, such as 700-799");
    }
    return value;
}

/// The batch with targets of at most this side.
FitTarget target_of(const Model& model, const TrainingBatch& batch, std::int64_t resolution) {
    FitTarget target{batch.input, batch.targets, batch.cameras, face_codes(model, batch)};
    while (resolution > 0 && target.targets.size() > 1 && target.targets.back().shape(1) > resolution) target.targets.pop_back();
    return target;
}

int side_of(const FitTarget& target) {
    return static_cast<int>(target.targets.back().shape(1));
}

void add_turning_row(std::vector<Tensor>& tiles, const Model& model, const FitReport& report, const Codes& codes,
                     std::int64_t index, std::int64_t samples) {
    const std::int64_t side = report.fitted.shape(0);
    tiles.push_back(report.target);
    tiles.push_back(report.fitted);
    for (const double yaw_degrees : {-30.0, -15.0, 0.0, 15.0, 30.0}) {
        const Camera camera = model_camera(model, radians_from_degrees(yaw_degrees), 0.0, 0.0);
        tiles.push_back(render_view(model, codes, index, camera, {.samples_per_ray = samples, .resolution = side}).picture);
    }
}

void write_row(std::ostream& stream, const char* name, const ImageMetrics& metrics) {
    stream << std::left << std::setw(9) << name << std::right << std::fixed << std::setprecision(4) << std::setw(9) << metrics.l1
           << std::setw(11) << metrics.l1_mean;
    if (metrics.lpips) stream << std::setw(9) << *metrics.lpips;
    stream << std::setw(9) << metrics.ssim << std::setprecision(2) << std::setw(9) << metrics.psnr << '\n';
}

struct Means {
    ImageMetrics initial;
    ImageMetrics fitted;
    double counting_samples = 0.0;
};

Means means(const std::vector<FaceScore>& scores) {
    std::vector<ImageMetrics> initial;
    std::vector<ImageMetrics> fitted;
    double counting_samples = 0.0;
    for (const FaceScore& score : scores) {
        initial.push_back(score.initial);
        fitted.push_back(score.fitted);
        counting_samples += score.counting_samples / static_cast<double>(scores.size());
    }
    return {mean(initial), mean(fitted), counting_samples};
}

}  // namespace

FaceRange parse_range(const std::string& text) {
    if (text.empty()) return {};
    const std::size_t dash = text.find('-');
    const std::int64_t first = parse_index(std::string_view(text).substr(0, dash), text);
    if (dash == std::string::npos) return {first, first};
    if (dash + 1 == text.size()) return {first, -1};
    const std::int64_t last = parse_index(std::string_view(text).substr(dash + 1), text);
    if (last < first) fail<UsageError>("--ids ", text, ": the range ends before it begins");
    return {first, last};
}

Evaluation evaluate(const Model& model, const ReconstructionLoss& loss, const Dataset& faces, const EvaluationOptions& options) {
    const std::int64_t last = options.range.last < 0 ? faces.size() - 1 : std::min(options.range.last, faces.size() - 1);
    if (options.range.first > last) fail<ConfigError>("--ids: the folder has only ", faces.size(), " faces, counted from 0");
    const InterruptGuard guard;
    const std::int64_t asked = last - options.range.first + 1;
    Progress progress({.title = "evaluate", .total = asked, .unit = "faces"});
    FitOptions fitting = options.fitting;
    if (!options.fit) fitting.steps = 0;
    Evaluation evaluation;
    std::vector<Tensor> tiles;
    std::int64_t begin = options.range.first;
    for (; begin <= last && !interrupted(); begin += options.batch) {
        std::vector<Face> group;
        for (std::int64_t i = begin; i <= std::min(last, begin + options.batch - 1); ++i) {
            Face face = faces.load(i);
            // Else the set has put another face in the place of a broken one.
            if (face.id == faces.ids()[static_cast<std::size_t>(i)]) group.push_back(std::move(face));
        }
        if (group.empty()) continue;
        const TrainingBatch batch = make_batch(group);
        const FitTarget target = target_of(model, batch, options.resolution);
        const Tensor mask = resize_box(batch.mask, side_of(target), side_of(target)).value();
        const FitResult result = fit_codes(model, loss, target, fitting);
        if (std::ssize(result.losses) < fitting.steps) break;
        for (std::size_t i = 0; i < group.size(); ++i) {
            const auto index = static_cast<std::int64_t>(i);
            const FitReport report = report_fit(model, target, mask, result, index, options.lpips);
            evaluation.scores.push_back({group[i].id, report.initial_metrics, report.fitted_metrics, report.counting_samples});
            if (static_cast<std::int64_t>(evaluation.scores.size()) <= options.yaw_rows) {
                add_turning_row(tiles, model, report, result.fitted, index, model.config().reconstruction.fit_samples_per_ray);
            }
        }
        const Means so_far = means(evaluation.scores);
        std::ostringstream text;
        text << std::fixed << std::setprecision(2) << "PSNR " << so_far.initial.psnr << " initial, " << so_far.fitted.psnr
             << " fitted";
        progress.update(static_cast<std::int64_t>(evaluation.scores.size()), text.str());
    }
    progress.finish();
    if (evaluation.scores.empty())
        fail<FileError>(interrupted() ? "interrupted; no face was scored" : "--ids: none of these faces can be read");
    if (begin <= last) {
        std::ostringstream text;
        text << "interrupted after " << evaluation.scores.size() << " of " << asked << " faces";
        evaluation.incomplete = text.str();
    }
    if (!tiles.empty()) evaluation.turning_sheet = tile_images(tiles, 7);
    return evaluation;
}

std::string table(const std::vector<FaceScore>& scores, bool fitted) {
    const Means mean = means(scores);
    std::ostringstream text;
    text << scores.size() << " face(s)      L1  L1 (mean)" << (mean.initial.lpips ? "    LPIPS" : "") << "     SSIM  PSNR dB\n";
    write_row(text, "initial", mean.initial);
    if (fitted) write_row(text, "fitted", mean.fitted);
    text << std::setprecision(1) << 100.0 * mean.counting_samples << " % of the samples count (weight above " << std::defaultfloat
         << counting_weight << ")\n";
    return text.str();
}

JsonValue to_json(const std::vector<FaceScore>& scores, bool fitted) {
    const auto row = [&](const ImageMetrics& initial, const ImageMetrics& after) {
        JsonValue object = JsonValue::object({{"initial", to_json(initial)}});
        if (fitted) object.add("fitted", to_json(after));
        return object;
    };
    const Means mean = means(scores);
    JsonValue faces = JsonValue::object();
    for (const FaceScore& score : scores) faces.add(score.id, row(score.initial, score.fitted));
    return JsonValue::object({{"count", scores.size()},
                              {"mean", row(mean.initial, mean.fitted)},
                              {"counting_samples", mean.counting_samples},
                              {"faces", faces}});
}

}  // namespace stymo
