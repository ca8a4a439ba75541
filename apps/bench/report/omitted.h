#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/bench/report/section.h"
#include "core/work_counts.h"
#include "nn/models/realtime/face_renderer.h"

namespace stymo {

/// What a frame shows of one head.
struct Scene {
    std::string name;
    std::string what;
    Camera camera;
    Camera beside{};     ///< nearly the same, so that frames in turn are new ones
    bool empty = false;  ///< of a field that has no density anywhere
};
/// Frontal, in profile, far away, half outside of the frame, empty.
[[nodiscard]] std::vector<Scene> omitted_scenes(const Model& model);

/// Frames of a scene in one mode: counts of one, and the median time of many.
struct SceneFrames {
    Tensor picture;
    RenderCounts counts;
    WorkCounts work;
    double seconds = 0.0;
};
/// `model` with a head or without. `samples` per ray.
[[nodiscard]] SceneFrames scene_frames(const Model& model, const Codes& codes, const Scene& scene, RenderMode mode,
                                       std::int64_t samples, int repeats);
/// Takes all density from a model's field.
void empty_field(const Model& model);

/// A job done with what it needs, and with everything that there is.
struct OmittedJob {
    std::string name;
    std::string left_out;
    std::function<Tensor()> needed;      ///< the result, as numbers to compare
    std::function<Tensor()> everything;  ///< the same numbers, but for rounding
    std::function<void()> before{};      ///< each run of `needed`, not part of it; may be empty
};
/// Render without mask, edit of light only, fit without perceptual term, stage 1, evaluation; of the subject's first face.
/// The subject outlives them; the jobs leave its model frozen.
[[nodiscard]] std::vector<OmittedJob> omitted_jobs(BenchSubject& subject, const BenchOptions& options, std::uint64_t seed);

/// How a job went.
struct JobRun {
    Tensor result;
    WorkCounts work;
    double seconds = 0.0;  ///< median
};
/// Runs it once unmeasured, then `repeats` times within a few seconds; with 0, or without the time, the first run counts.
[[nodiscard]] JobRun run_job(const std::function<Tensor()>& job, const std::function<void()>& before, int repeats);

/// What scenes and jobs leave out, with time and error against doing everything.
[[nodiscard]] ReportSection omitted_section();

}  // namespace stymo
