#include <algorithm>
#include <map>
#include <memory>

#include "apps/bench/frames.h"
#include "apps/bench/study.h"
#include "apps/bench/work.h"
#include "core/parallel.h"

namespace stymo {

namespace {

/// Rows in which one quantity is varied. Time and work are relative to the quantity's first value.
class Growth {
public:
    explicit Growth(const StudyInputs& inputs)
        : inputs_(inputs), subject_(make_subject(inputs.bench, inputs.seed)) {
        for (const std::int64_t samples : {16, 32, 64, 128, 256})
            add("samples per ray", samples, {.samples_per_ray = samples});
        const DecoderConfig& decoder = subject_.model.config().decoder;
        for (std::int64_t side = 64; side <= decoder.resolution; side *= 2)
            add("side of the image", side,
                {.samples_per_ray = inputs.bench.samples, .resolution = side});
        const std::int64_t half = std::max<std::int64_t>(decoder.field_width / 2, 1);
        for (const std::int64_t width : {half, 2 * half, 3 * half})
            rows_.push_back({{"width of the field", width}, [=, this] {
                                 const BenchSubject wide = with_width(width);
                                 return measured("width", wide, exact(), 1);
                             }});
        for (int threads = 1; threads <= thread_count(); threads *= 2)
            rows_.push_back(
                {{"threads", static_cast<std::int64_t>(threads)}, [=, this, all = thread_count()] {
                     set_thread_count(threads);
                     Row row = measured("threads", subject_, exact(), threads);
                     set_thread_count(all);
                     return row;
                 }});
    }
    [[nodiscard]] const std::vector<StudyRow>& rows() const { return rows_; }

private:
    [[nodiscard]] RendererOptions exact() const {
        return {.mode = RenderMode::exact, .samples_per_ray = inputs_.bench.samples};
    }
    void add(const std::string& varied, std::int64_t value, RendererOptions frame) {
        frame.mode = RenderMode::exact;
        rows_.push_back(
            {{varied, value}, [=, this] { return measured(varied, subject_, frame, 1); }});
    }
    /// Random weights; the encoder takes no part.
    [[nodiscard]] BenchSubject with_width(std::int64_t width) const {
        ModelConfig config = subject_.model.config();
        config.encoder.backbone = "small_conv";
        config.encoder.backbone_weights.clear();
        config.decoder.field_width = width;
        BenchOptions random = inputs_.bench;
        random.data.clear();
        return random_subject(config, random, inputs_.seed);
    }
    /// `threads` parts of the work are done at the same time.
    Row measured(const std::string& varied, const BenchSubject& subject,
                 const RendererOptions& frame, int threads) {
        FaceRenderer renderer(subject.model, frame);
        const double seconds = time_frames(subject, renderer, inputs_.bench.repeats).median();
        const double work =
            frame_work(subject.model, frame.resolution).of_frame(frame.samples_per_ray) / threads;
        const auto [first, is_first] = first_.try_emplace(varied, seconds, work);
        const double times_time = seconds / first->second.first,
                     times_work = work / first->second.second;
        return {seconds, work, times_time, times_work, times_time / times_work};
    }

    const StudyInputs& inputs_;
    BenchSubject subject_;
    std::vector<StudyRow> rows_;
    std::map<std::string, std::pair<double, double>> first_;  ///< seconds and work by quantity
};

std::string billions(const Value& value) {
    return decimal(std::get<double>(value) / 1e9, 3);
}

void write_growth(Page& page, const StudyInputs& inputs) {
    Growth growth(inputs);
    page.add(run_study({.name = "growth",
                        .columns = {{"varied", "varied"},
                                    {"value", "value"},
                                    {"median_seconds", "ms", milliseconds},
                                    {"multiply_adds", "GMAC", billions},
                                    {"times_time", "time", fixed<2>},
                                    {"times_work", "work", fixed<2>},
                                    {"time_per_work", "time / work", fixed<2>}}},
                       growth.rows()));
}

}  // namespace

Study growth_study() {
    return {
        .name = "growth", .title = "Growth of a frame's time with its work", .write = write_growth};
}

}  // namespace stymo
