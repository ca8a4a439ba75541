#include "apps/bench/subject.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/angle.h"
#include "nn/realtime/view.h"
#include "train/data/dataset.h"

namespace stymo {

namespace {

/// Standard deviation of random codes, about that of an encoder's codes.
constexpr double code_deviation = 0.1;

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
    Face face;
    face.id = "random";
    face.image = rng.uniform({side, side, 3}, 0.0, 1.0);
    face.mask = Tensor::full({side, side, 1}, 1.0);
    face.pose = frontal_pose(config.camera);
    face.intrinsics = config.camera.intrinsics;
    return face;
}

Codes random_codes(int faces, Rng& rng) {
    Codes codes;
    for (std::size_t group = 0; group < code_sizes.size(); ++group)
        codes.groups[group] = rng.normal({faces, code_sizes[group]}, 0.0, code_deviation);
    return codes;
}

BenchSubject subject_of(Model model, const BenchOptions& options, std::uint64_t seed) {
    model.parameters().set_trainable("", false);
    Rng rng = Rng(seed).split("faces");
    BenchSubject subject{std::move(model), {}, {}, {}};
    const ModelConfig& config = subject.model.config();
    if (options.data.empty()) {
        for (int i = 0; i < options.faces; ++i) subject.photos.push_back(random_face(config, rng));
        subject.codes = random_codes(options.faces, rng);
    } else {
        const Dataset data(options.data, config.decoder.resolution, {.cache_megabytes = 0},
                           Split::all, frontal_pose(config.camera));
        const std::int64_t faces = std::min<std::int64_t>(options.faces, data.size());
        for (std::int64_t i = 0; i < faces; ++i) subject.photos.push_back(data.load(i));
        subject.codes = detached(face_codes(subject.model, make_batch(subject.photos)));
    }
    subject.views = orbit(subject.model, options.views);
    return subject;
}

}  // namespace

BenchSubject make_subject(const BenchOptions& options, std::uint64_t seed) {
    if (options.model.empty()) return random_subject({}, options, seed);
    BenchSubject subject = subject_of(Model::load(options.model), options, seed);
    subject.trained = true;
    return subject;
}

BenchSubject random_subject(const ModelConfig& config, const BenchOptions& options,
                            std::uint64_t seed) {
    Rng rng = Rng(seed).split("model");
    return subject_of(Model(config, rng), options, seed);
}

}  // namespace stymo
