#include "apps/drive/driven_face.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/angle.h"
#include "core/ops/ops.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"

namespace stymo {
namespace {

/// The whole head, as it turns around its middle.
Camera film_camera(const Model& model, const CodeFile& face, double yaw, double pitch,
                   double roll) {
    const CameraConfig& camera = model.config().camera;
    return turned_camera(camera, head_middle, yaw, pitch, roll, usual_distance(camera, face.pose));
}

/// A renderer for the face from the sides that a film may show.
ChosenRenderer film_renderer(const DrivenFaceOptions& options, const Model& model,
                             const CodeFile& face) {
    constexpr int sides = 96;  // of which six are checked, from -40 to 40 degrees
    constexpr double largest_yaw = 48.0;
    std::vector<FaceView> views;
    for (int i = 0; i < sides; ++i) {
        const double yaw = largest_yaw * (2.0 * i / (sides - 1) - 1.0);
        views.push_back(
            {face.codes, film_camera(model, face, radians_from_degrees(yaw), 0.0, 0.0)});
    }
    return choose_renderer(model, views,
                           {.mode = model.decoder().folds() ? RenderMode::skip : RenderMode::exact,
                            .samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                            .resolution = options.size,
                            .mask = true,
                            .remove_floaters = true},
                           options.psnr);
}

Variable mean_expression(const Model& model) {
    if (!model.code_statistics()) return Variable(unmoved());
    constexpr std::int64_t begin = code_sizes[0], end = begin + code_sizes[1];
    const Variable mean(
        model.code_statistics()->mean().reshaped({1, code_size}).to(DType::float32));
    return slice(mean, 1, begin, end);
}

}  // namespace

Tensor unmoved() {
    return Tensor::zeros({1, code_sizes[1]});
}

DrivenFace::DrivenFace(DrivenFaceOptions options, const Model& model, CodeFile face,
                       const FaceDetector* detector)
    : options_(std::move(options)),
      model_(model),
      detector_(detector),
      face_(std::move(face)),
      neutral_(mean_expression(model)),
      chosen_(film_renderer(options_, model, face_)) {
    if (options_.identity.empty()) return;
    identity_.emplace(options_.identity);
    chosen_.renderer.show(face_.codes);
    embedding_ = embedding_from(0.0, 0.0, 0.0);
}

Tensor DrivenFace::frame(const FilmFrame& seen) {
    if (seen.found || !last_.defined()) {
        Codes codes = face_.codes;
        Variable& expression = codes.groups[1];
        if (options_.absolute) expression = neutral_;
        expression = expression + Variable(seen.change);
        last_ = rendered(codes, seen.pose.yaw, seen.pose.pitch, seen.roll);
        if (seen.found) measure(seen);
    } else {
        measures_.film.add({});
        measures_.driven.add({});
    }
    return last_;
}

Tensor DrivenFace::rendered(const Codes& codes, double yaw, double pitch, double roll) {
    chosen_.renderer.show(codes);
    const View view = chosen_.renderer.render(film_camera(model_, face_, yaw, pitch, roll));
    return with_soft_edge(view.image, view.mask);
}

std::vector<double> DrivenFace::embedding_from(double yaw, double pitch, double roll) {
    // The network knows faces in FFHQ's crop.
    const Tensor image = chosen_.renderer.render(model_camera(model_, yaw, pitch, roll)).image;
    const Variable row(image.reshaped({1, image.shape(0), image.shape(1), 3}));
    return identity_->embeddings(row * 2.0 - 1.0).value().to_vector();
}

void DrivenFace::measure(const FilmFrame& seen) {
    if (options_.measure) {
        if (seen.starts) {
            measures_.film.add({});
            measures_.driven.add({});
        }
        measures_.film.add(seen.landmarks);
        const auto faces = detector_->find(last_, FaceSearch::quick);
        measures_.driven.add(faces.empty() ? std::optional<Landmarks>() : faces.front().landmarks);
    }
    if (!identity_) return;
    const std::vector<double> other = embedding_from(seen.pose.yaw, seen.pose.pitch, seen.roll);
    const double cosine =
        std::inner_product(embedding_.begin(), embedding_.end(), other.begin(), 0.0);
    measures_.least_cosine = std::min(measures_.least_cosine, cosine);
    measures_.cosines += cosine;
    ++measures_.compared;
}

}  // namespace stymo
