#include "apps/bench/report/omitted.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/bench/report.h"
#include "core/metrics.h"

namespace stymo {

namespace {

constexpr double millisecond = 1e-3;
constexpr double mebibyte = 1048576.0;

ReportCell milliseconds(double seconds) {
    return seconds / millisecond;
}

double largest_difference(const Tensor& a, const Tensor& b) {
    const std::vector<double> left = a.to_vector(), right = b.to_vector();
    double largest = 0.0;
    for (std::size_t i = 0; i < left.size(); ++i) largest = std::max(largest, std::abs(left[i] - right[i]));
    return largest;
}

/// |a - b| / |b| in the Euclidean norm.
double relative_difference(const Tensor& a, const Tensor& b) {
    const std::vector<double> left = a.to_vector(), right = b.to_vector();
    double squares = 0.0, all = 0.0;
    for (std::size_t i = 0; i < left.size(); ++i) {
        squares += (left[i] - right[i]) * (left[i] - right[i]);
        all += right[i] * right[i];
    }
    return all > 0.0 ? std::sqrt(squares / all) : 0.0;
}

ReportCell decibels(double psnr) {
    return std::isfinite(psnr) ? ReportCell(decimal(psnr, 1), psnr) : ReportCell("equal", JsonValue());
}

std::vector<ReportCell> scene_row(const Scene& scene, const SceneFrames& needed, const SceneFrames& all) {
    const RenderCounts& counts = needed.counts;
    return {scene.name,
            counts.samples,
            counts.field_samples,
            counts.tiles,
            counts.pixels,
            counts.pixels_computed,
            counts.layers,
            counts.layers_computed,
            needed.work.buffers,
            milliseconds(all.seconds),
            milliseconds(needed.seconds),
            decibels(peak_signal_to_noise_ratio(needed.picture, all.picture)),
            largest_difference(needed.picture, all.picture)};
}

void write_scenes(ReportWriter& report, const BenchSubject& subject, const ReportInputs& inputs) {
    report.heading("Scenes");
    report.text(
        "Frames with every sample (exact) against those that leave out what does not count (skip), each from another side than "
        "the one before; layers are those of field, render blocks and mask branch, and buffers are tensors that one more frame "
        "allocates. An empty scene is the same head with a field that has no density.");
    BenchSubject without = make_subject(inputs.bench, inputs.seed);
    empty_field(without.model);
    std::vector<std::vector<ReportCell>> rows;
    PlotSeries series{"skip", {}};
    for (const Scene& scene : omitted_scenes(subject.model)) {
        const Model& model = scene.empty ? without.model : subject.model;
        const auto frames = [&](RenderMode mode) {
            return scene_frames(model, subject.codes, scene, mode, inputs.bench.samples, inputs.bench.repeats);
        };
        const SceneFrames needed = frames(RenderMode::skip), all = frames(RenderMode::exact);
        rows.push_back(scene_row(scene, needed, all));
        series.points.push_back({static_cast<double>(needed.counts.field_samples), needed.seconds / millisecond, scene.name});
    }
    std::ranges::sort(series.points, {}, &PlotPoint::x);
    report.table("omitted_scenes",
                 {"scene", "samples", "through the field", "tiles", "pixels", "pixels computed", "layers", "layers computed",
                  "buffers", "ms, everything", "ms", "PSNR dB", "largest difference"},
                 rows);
    report.plot("omitted_scenes_time", {.title = "Scenes by the samples that count in them",
                                        .x_label = "samples through the field",
                                        .y_label = "time of a frame, ms",
                                        .series = {std::move(series)},
                                        .x_scale = PlotScale::linear,
                                        .y_scale = PlotScale::linear});
}

std::vector<ReportCell> job_row(const OmittedJob& job, const std::string& done, const JobRun& run, const ReportCell& error) {
    return {job.name,
            done,
            run.work.operations,
            run.work.gradient_rules,
            run.work.gradients,
            run.work.field_points,
            run.work.parameters,
            run.work.buffers,
            ReportCell(decimal(static_cast<double>(run.work.peak_bytes) / mebibyte, 0), run.work.peak_bytes),
            milliseconds(run.seconds),
            error};
}

void write_jobs(ReportWriter& report, BenchSubject& subject, const ReportInputs& inputs) {
    report.heading("Jobs");
    report.text(
        "Each job with what it needs, and with all that it leaves out computed too, at a weight of 1e-20 where it is a loss. "
        "Counted by the program itself (`core/work_counts.h`): weights are tensors of parameters that networks made in the "
        "job, so 0 means that no network was constructed; the error is the relative difference of what both have in common.");
    std::vector<std::vector<ReportCell>> rows;
    std::string left_out;
    for (const OmittedJob& job : omitted_jobs(subject, inputs.bench, inputs.seed)) {
        const JobRun needed = run_job(job.needed, job.before, inputs.bench.repeats);
        const JobRun everything = run_job(job.everything, {}, inputs.bench.repeats);
        rows.push_back(job_row(job, "what it needs", needed, relative_difference(needed.result, everything.result)));
        rows.push_back(job_row(job, "everything", everything, {"", JsonValue()}));
        left_out += "- " + job.name + " leaves out " + job.left_out + ".\n";
    }
    report.table("omitted_jobs",
                 {"job", "done", "operations", "gradient rules", "gradients", "field points", "weights made", "buffers",
                  "peak MiB", "ms", "error"},
                 rows);
    report.text(left_out);
}

void write_omitted(ReportWriter& report, const ReportInputs& inputs) {
    ReportInputs one_face = inputs;
    one_face.bench.faces = 1;
    BenchSubject subject = make_subject(one_face.bench, one_face.seed);
    write_scenes(report, subject, one_face);
    write_jobs(report, subject, one_face);
}

}  // namespace

ReportSection omitted_section() {
    return {.name = "omitted",
            .title = "What a scene or a job does not need",
            .seconds = 60.0,
            .needs_model = true,
            .write = write_omitted};
}

}  // namespace stymo
