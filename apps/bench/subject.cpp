#include "apps/bench/subject.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "apps/bench/peak.h"
#include "core/angle.h"
#include "core/clock.h"
#include "core/metrics.h"
#include "core/ops/ops.h"
#include "fit/shipped_files.h"
#include "nn/realtime/chosen_tolerance.h"
#include "nn/realtime/view.h"
#include "train/data/dataset.h"

namespace stymo {

namespace {

std::vector<Camera> orbit(const Model& model, int count) {
    std::vector<Camera> views;
    for (int i = 0; i < count; ++i) {
        const double turn = 2.0 * std::numbers::pi * i / count;
        views.push_back(model_camera(model, radians_from_degrees(30.0) * std::sin(turn),
                                     radians_from_degrees(8.0) * std::cos(turn), 0.0));
    }
    return views;
}

Face random_face(const ModelConfig& config, Rng& rng) {
    const std::int64_t side = config.decoder.resolution;
    return {.id = "random",
            .image = rng.uniform({side, side, 3}, 0.0, 1.0),
            .mask = Tensor::full({side, side, 1}, 1.0),
            .pose = frontal_pose(config.camera),
            .intrinsics = config.camera.intrinsics,
            .code = {}};
}

/// The first photos of the folder, or its last ones; fewer if it has fewer.
std::vector<Face> photos_of(const BenchOptions& options, const ModelConfig& config,
                            std::int64_t faces, bool last) {
    const Dataset data(options.data, config.decoder.resolution, {.cache_megabytes = 0}, Split::all,
                       config.camera);
    const std::int64_t count = std::min(faces, data.size());
    std::vector<Face> photos;
    for (std::int64_t i = 0; i < count; ++i)
        photos.push_back(data.load(last ? data.size() - count + i : i));
    return photos;
}

}  // namespace

void Timing::add(double run_seconds) {
    seconds.push_back(run_seconds);
    multiply_adds.push_back(kernels::measure_multiply_adds());
}

void Timing::add(const Timing& other) {
    seconds.insert(seconds.end(), other.seconds.begin(), other.seconds.end());
    multiply_adds.insert(multiply_adds.end(), other.multiply_adds.begin(),
                         other.multiply_adds.end());
}

Timing time_repeated(int repeats, double at_least_seconds, const std::function<void()>& body) {
    constexpr int most = 100;
    body();
    Timing timing;
    const double begin = seconds_now();
    for (int i = 0; i < repeats || (i < most && seconds_now() - begin < at_least_seconds); ++i) {
        const double start = seconds_now();
        body();
        timing.add(seconds_now() - start);
    }
    return timing;
}

BenchSubject make_subject(const BenchOptions& options) {
    Rng rng = Rng(options.seed).split("model");
    Model model = options.model.empty() ? Model({}, rng) : Model::load(named_model(options.model));
    model.parameters().set_trainable("", false);
    BenchSubject subject{std::move(model), {}, {}, {}};
    const ModelConfig& config = subject.model.config();
    if (options.data.empty()) {
        // About the standard deviation of an encoder's codes.
        constexpr double deviation = 0.1;
        Rng draws = Rng(options.seed).split("faces");
        for (int i = 0; i < options.faces; ++i)
            subject.photos.push_back(random_face(config, draws));
        for (std::size_t group = 0; group < code_sizes.size(); ++group)
            subject.codes.groups[group] =
                draws.normal({options.faces, code_sizes[group]}, 0.0, deviation);
    } else {
        subject.photos = photos_of(options, config, options.faces, false);
        subject.codes = detached(
            face_codes(subject.model,
                       make_batch(subject.photos, subject.model.decoder().ladder().smallest())));
    }
    subject.views = orbit(subject.model, options.views);
    return subject;
}

std::vector<Face> last_photos(const BenchOptions& options, const ModelConfig& config,
                              std::int64_t faces) {
    return photos_of(options, config, faces, true);
}

Timing time_frames(const BenchSubject& subject, FaceRenderer& renderer, int repeats) {
    const double seconds_of_a_face = 0.04 * repeats;
    Timing timing;
    std::size_t view = 0;
    for (std::int64_t face = 0; face < subject.codes.batch(); ++face) {
        renderer.show(subject.codes, face);
        const auto next = [&] {
            static_cast<void>(renderer.render(subject.views[view++ % subject.views.size()]));
        };
        timing.add(time_repeated(repeats, seconds_of_a_face, next));
    }
    return timing;
}

double field_work(const Model& model, std::int64_t samples_per_ray) {
    const DecoderWork work = model.decoder().work();
    return static_cast<double>(work.rays * (work.field.sample * samples_per_ray + work.field.ray));
}

double frame_work(const Model& model, std::int64_t samples_per_ray) {
    return field_work(model, samples_per_ray) + static_cast<double>(model.decoder().work().blocks);
}

Images all_images(const BenchSubject& subject, const RendererOptions& options) {
    FaceRenderer renderer(subject.model, options);
    Images images;
    for (std::int64_t face = 0; face < subject.codes.batch(); ++face) {
        renderer.show(subject.codes, face);
        for (const Camera& view : subject.views) images.push_back(renderer.render(view).image);
    }
    return images;
}

ImageError error_of(const Images& images, const Images& exact) {
    ImageError error;
    FrameError worst;
    double squares = 0.0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
        const double psnr = peak_signal_to_noise_ratio(images.at(i), exact[i]);
        error.psnr_mean += psnr / static_cast<double>(exact.size());
        error.psnr_worst = std::min(error.psnr_worst, psnr);
        worst.add(images[i], exact[i]);
        squares += std::pow(10.0, -psnr / 10.0) / static_cast<double>(exact.size());
    }
    error.worst_pixel = worst.worst_pixel;
    error.root_mean_square = std::sqrt(squares);
    return error;
}

}  // namespace stymo
