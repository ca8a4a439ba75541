#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "apps/bench/study.h"
#include "apps/common/tool_options.h"
#include "apps/prep/pipeline.h"
#include "core/clock.h"
#include "core/io/folder_in_progress.h"
#include "core/parallel.h"
#include "core/parallel_recording.h"
#include "fit/fitter.h"
#include "fit/tuning.h"
#include "train/data/folder_scan.h"

/// The study of processors: what a job would gain from more of them than the machine has.
namespace stymo {

namespace {

constexpr std::array<int, 5> thread_counts{1, 2, 4, 16, 64};

/// A job for the number of threads that is set when it is made.
using Run = std::function<void()>;

struct ScaledJob {
    std::string name;
    std::function<Run()> make;
};

Run frame_run(const BenchSubject& subject, RenderMode mode, std::int64_t samples) {
    const auto renderer = std::make_shared<FaceRenderer>(
        subject.model, RendererOptions{.mode = mode, .samples_per_ray = samples});
    renderer->show(codes_of_face(subject.codes, 0));
    const auto next = std::make_shared<std::size_t>(0);
    return [=, &subject] {
        static_cast<void>(renderer->render(subject.views[(*next)++ % subject.views.size()]));
    };
}

/// Fits and tuning prepare their targets once, so several steps are recorded.
constexpr std::int64_t recorded_steps = 8;

Run fit_steps(const BenchSubject& subject, const ReconstructionLoss& loss) {
    return [&] {
        static_cast<void>(fit_codes(subject.model, loss,
                                    make_batch(std::span(subject.photos).first(1)),
                                    {.steps = recorded_steps}));
    };
}

Run tuning_steps(const BenchSubject& subject, const ReconstructionLoss& loss) {
    return [&] {
        Model tuned = subject.model.copy();
        const FaceBatch face = make_batch(std::span(subject.photos).first(1));
        static_cast<void>(tune_decoder(subject.model, tuned, loss, face,
                                       codes_of_face(subject.codes, 0), face.cameras,
                                       {.steps = recorded_steps}));
    };
}

/// As many photos as there are, at most 64, none of whose masks are known.
Run preparation(const std::vector<FaceFiles>& photos) {
    constexpr std::size_t most = 64;
    const auto input = std::make_shared<FolderInProgress>(std::filesystem::temp_directory_path() /
                                                          "stymo-bench-photos");
    // By number, because folders of a large set may have images of the same name.
    for (std::size_t i = 0; i < std::min(most, photos.size()); ++i) {
        const std::filesystem::path& image = photos[i].image;
        std::filesystem::copy_file(
            image, input->path() / (std::to_string(i) + image.extension().string()));
    }
    PhotoPreparationSettings settings;
    settings.landmark_model = shipped_landmark_network();
    settings.mask_network = shipped_mask_network();
    const auto preparation = std::make_shared<PhotoPreparation>(settings);
    return [=] {
        const FolderInProgress out(std::filesystem::temp_directory_path() / "stymo-bench-faces");
        OneRank alone;
        static_cast<void>(
            PreparationRun({input->path(), out.path(), false}, *preparation, {}, alone).lead());
    };
}

/// Adds the time that so many threads do not save, by place. Chunks that have help are not looked
/// into.
void add_lost(const WorkProfile& profile, int threads, std::map<std::string, double>& lost) {
    const double spare = 1.0 - 1.0 / threads;
    for (const RecordedLoop& loop : profile.loops) {
        const std::filesystem::path file = loop.file;
        double work = 0.0;
        for (const WorkProfile& chunk : loop.chunks) work += chunk.work_seconds();
        lost["before " + file.filename().string()] += loop.before_seconds * spare;
        lost["in " + file.filename().string()] += loop.seconds_on(threads) - work / threads;
    }
    lost["at the end"] += profile.after_seconds * spare;
}

std::string cap_of(const WorkProfile& profile, int threads) {
    std::map<std::string, double> lost;
    add_lost(profile, threads, lost);
    std::vector<std::pair<double, std::string>> sorted;
    for (const auto& [where, seconds] : lost) sorted.emplace_back(seconds, where);
    std::ranges::sort(sorted, std::greater());
    std::string text;
    constexpr std::size_t named = 3;
    for (std::size_t i = 0; i < std::min(named, sorted.size()); ++i)
        text += (i > 0 ? ", " : "") + sorted[i].second + " " +
                percent(sorted[i].first / profile.seconds_on(threads));
    return text;
}

/// What it costs to begin and to join a loop on several threads, without delays by other programs.
double loop_seconds() {
    constexpr int rounds = 50, loops = 50;
    double least = std::numeric_limits<double>::infinity();
    for (int round = 0; round < rounds; ++round) {
        const double begin = seconds_now();
        for (int i = 0; i < loops; ++i) parallel_for(2, 1, [](std::int64_t, std::int64_t) {});
        least = std::min(least, (seconds_now() - begin) / loops);
    }
    return least;
}

/// `body` with so many threads; then the former number is set again.
auto with_threads(int count, const auto& body) {
    const std::shared_ptr<void> restored(
        nullptr, [before = thread_count()](void*) { set_thread_count(before); });
    set_thread_count(count);
    return body();
}

WorkProfile recorded(const ScaledJob& job, int threads) {
    return with_threads(threads, [&] {
        const Run run = job.make();
        run();  // what is done once
        const ParallelRecording recording;
        run();
        return recording.profile();
    });
}

double clocked(const ScaledJob& job, int threads, int repeats) {
    return with_threads(threads, [&] { return time_repeated(repeats, 0.0, job.make()).median(); });
}

Row scaling_of(const ScaledJob& job, int repeats) {
    const int processors = thread_count();
    const double loop = loop_seconds();
    const double alone = clocked(job, 1, repeats);
    std::array<double, thread_counts.size()> predicted{};
    WorkProfile largest;
    for (std::size_t i = 0; i < thread_counts.size(); ++i) {
        const WorkProfile profile = recorded(job, thread_counts[i]);
        predicted[i] = profile.seconds_on(thread_counts[i], loop);
        if (thread_counts[i] == 16) largest = profile;
    }
    const auto gain = [&](std::size_t i) { return predicted[0] / predicted[i]; };
    Row row{largest.work_seconds(), largest.span_seconds(), alone / predicted[0], gain(1),
            processors >= 2 ? Value(alone / clocked(job, 2, repeats)) : Value()};
    row.insert(row.end(), {gain(2), gain(3), gain(4), cap_of(largest, 16)});
    return row;
}

StudyPlan cores_plan(const StudyInputs& inputs) {
    const BenchOptions& bench = inputs.bench;
    // Before anything is measured, because it throws for a folder without images.
    const std::vector<FaceFiles> photos =
        bench.data.empty() ? std::vector<FaceFiles>() : scan_folder(bench.data).faces;
    const auto subject = std::make_shared<const BenchSubject>(make_subject(bench));
    // The loss of the model's fits; random weights of LPIPS do not change the time.
    ReconstructionConfig config = subject->model.config().reconstruction;
    config.perceptual.trunk = config.perceptual.heads = "random";
    const auto loss =
        std::make_shared<const ReconstructionLoss>(config, "", &subject->model.encoder());
    const auto frame = [=, samples = bench.samples](RenderMode mode) {
        return [=] { return frame_run(*subject, mode, samples); };
    };
    const auto training = [seed = bench.seed](const std::string& configuration) {
        return [=]() -> Run {
            const auto steps = std::make_shared<TrainingSteps>(configuration, seed);
            return [=] { static_cast<void>(steps->trainer.step()); };
        };
    };
    std::vector<ScaledJob> jobs{{"frame, exact", frame(RenderMode::exact)},
                                {"frame, skip", frame(RenderMode::skip)},
                                {"fit, 8 steps", [=] { return fit_steps(*subject, *loss); }},
                                {"tuning, 8 steps", [=] { return tuning_steps(*subject, *loss); }},
                                {"training step, celeba-128", training("celeba-128")},
                                {"training step, celeba-256", training("celeba-256")}};
    if (!photos.empty())
        jobs.push_back({"preparation of a folder", [=] { return preparation(photos); }});
    StudyPlan plan;
    for (const ScaledJob& job : jobs)
        plan.add({job.name}, [=, repeats = bench.repeats] { return scaling_of(job, repeats); });
    plan.setting =
        "`work` is the time of all chunks and of what runs between them, `span` that of the "
        "critical path. Predictions let threads take the chunks in order; they do not model memory "
        "and clock rates. `one` and `two` compare them with the clock.";
    return plan;
}

}  // namespace

Study cores_study() {
    return {.part = "cores",
            .name = "cores",
            .title = "More processors",
            .varied = "job, and the number of threads that it plans for",
            .measured = "work and span of all chunks of parallel loops; the gain over one thread",
            .reference = "the clock, with one thread and with two",
            .columns = {"job", "work_seconds", "span_seconds", "one_measured_by_predicted",
                        "two_predicted", "two_measured", "four_predicted", "sixteen_predicted",
                        "sixty_four_predicted", "caps_at_sixteen"},
            .plan = cores_plan};
}

}  // namespace stymo
