#include "apps/bench/growth.h"

#include <algorithm>

#include "apps/bench/frames.h"
#include "apps/bench/work.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace stymo {

namespace {

/// Sets the number of threads for a scope.
class ThreadScope {
public:
    explicit ThreadScope(int threads) : before_(thread_count()) { set_thread_count(threads); }
    ~ThreadScope() { set_thread_count(before_); }
    ThreadScope(const ThreadScope&) = delete;
    ThreadScope& operator=(const ThreadScope&) = delete;

private:
    int before_;
};

class Growth {
public:
    Growth(const BenchSubject& subject, const BenchOptions& options, std::uint64_t seed)
        : subject_(subject), options_(options), seed_(seed), progress_({.title = "growth"}) {}

    std::vector<GrowthPoint> measure();

private:
    void samples();
    void sizes();
    void widths();
    void threads();
    /// `parts` of the work are done at the same time.
    void add(const std::string& varied, std::int64_t value, const BenchSubject& subject, const RendererOptions& frame,
             int parts = 1);
    [[nodiscard]] RendererOptions exact() const;

    const BenchSubject& subject_;
    const BenchOptions& options_;
    std::uint64_t seed_;
    Progress progress_;
    std::vector<GrowthPoint> points_;
};

RendererOptions Growth::exact() const {
    RendererOptions frame;
    frame.mode = RenderMode::exact;
    frame.samples_per_ray = options_.samples;
    return frame;
}

void Growth::add(const std::string& varied, std::int64_t value, const BenchSubject& subject, const RendererOptions& frame,
                 int parts) {
    if (interrupted()) fail<Error>("interrupted; nothing was written");
    FaceRenderer renderer(subject.model, frame);
    GrowthPoint point{.varied = varied, .value = value};
    point.seconds = time_frames(subject, renderer, options_.repeats).median();
    point.multiply_adds = frame_work(subject.model, frame.resolution).of_frame(frame.samples_per_ray) / parts;
    const auto first = std::ranges::find(points_, varied, &GrowthPoint::varied);
    if (first != points_.end()) {
        point.times_time = point.seconds / first->seconds;
        point.times_work = point.multiply_adds / first->multiply_adds;
    }
    points_.push_back(point);
    progress_.update(std::ssize(points_));
}

void Growth::samples() {
    for (const std::int64_t samples : {16, 32, 64, 128, 256}) {
        RendererOptions frame = exact();
        frame.samples_per_ray = samples;
        add("samples per ray", samples, subject_, frame);
    }
}

void Growth::sizes() {
    for (std::int64_t side = 64; side <= subject_.model.config().decoder.resolution; side *= 2) {
        RendererOptions frame = exact();
        frame.resolution = side;
        add("side of the picture", side, subject_, frame);
    }
}

void Growth::widths() {
    ModelConfig config = subject_.model.config();
    // Only the decoder is of interest.
    config.encoder.backbone = "small_conv";
    config.encoder.backbone_weights.clear();
    const std::int64_t half = std::max<std::int64_t>(config.decoder.field_width / 2, 1);
    BenchOptions random = options_;
    random.data.clear();
    for (const std::int64_t width : {half, 2 * half, 3 * half}) {
        config.decoder.field_width = width;
        add("width of the field", width, random_subject(config, random, seed_), exact());
    }
}

void Growth::threads() {
    const int most = thread_count();
    for (int threads = 1; threads <= most; threads *= 2) {
        const ThreadScope scope(threads);
        add("threads", threads, subject_, exact(), threads);
    }
}

std::vector<GrowthPoint> Growth::measure() {
    const InterruptGuard guard;
    samples();
    sizes();
    widths();
    threads();
    progress_.finish();
    return points_;
}

}  // namespace

std::vector<GrowthPoint> measure_growth(const BenchSubject& subject, const BenchOptions& options, std::uint64_t seed) {
    return Growth(subject, options, seed).measure();
}

Cells growth_cells(const std::vector<GrowthPoint>& points) {
    Cells cells{{"varied", "value", "ms", "GMAC", "time", "work", "time / work"}};
    for (const GrowthPoint& point : points)
        cells.push_back({point.varied, std::to_string(point.value), decimal(point.seconds * 1e3, 2),
                         decimal(point.multiply_adds / 1e9, 3), decimal(point.times_time, 2), decimal(point.times_work, 2),
                         decimal(point.times_time / point.times_work, 2)});
    return cells;
}

JsonValue to_json(const std::vector<GrowthPoint>& points) {
    std::vector<JsonValue> values;
    for (const GrowthPoint& point : points)
        values.push_back(JsonValue::object({{"varied", point.varied},
                                            {"value", point.value},
                                            {"median_seconds", point.seconds},
                                            {"multiply_adds", point.multiply_adds},
                                            {"times_time", point.times_time},
                                            {"times_work", point.times_work}}));
    return values;
}

}  // namespace stymo
