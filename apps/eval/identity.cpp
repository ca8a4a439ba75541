#include "apps/eval/identity.h"

#include <numeric>

#include "core/angle.h"
#include "core/ops/ops.h"
#include "fit/fit_report.h"
#include "nn/known_pixels.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

double cosine(const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

std::vector<double> IdentityMeasure::embedding(const Tensor& image) const {
    const Variable input(image.reshaped({1, image.shape(0), image.shape(1), 3}));
    return network_.embeddings(input * 2.0 - 1.0).value().to_vector();
}

IdentityScore IdentityMeasure::measure(const Model& model, const ComparedFace& face,
                                       const ComparedFace& other, const FitResult& fit) const {
    const ViewOptions options{.samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                              .resolution = face.batch.targets.back().shape(1)};
    const auto view = [&](const Camera& camera) {
        return render_view(model, fit.fitted, 0, camera, options).image;
    };
    const auto seen_by = [&](const Camera& camera) { return embedding(view(camera)); };
    const Tensor rendered = view(fit.cameras.front());
    const Tensor own = display_image(face.batch.targets.back(), 0);
    const std::vector<double> photo =
        embedding(where_known(known_in(face.batch, 0), own, rendered).value());
    const std::vector<double> fitted = embedding(rendered);
    const auto turned = [&](double degrees) {
        const double yaw = radians_from_degrees(degrees);
        return 0.5 * (cosine(fitted, seen_by(model_camera(model, yaw, 0.0, 0.0))) +
                      cosine(fitted, seen_by(model_camera(model, -yaw, 0.0, 0.0))));
    };
    return {.photo = cosine(photo, fitted),
            .turned_15 = turned(15.0),
            .turned_30 = turned(30.0),
            .other = cosine(photo, embedding(photo_with_guesses(other.batch)))};
}

}  // namespace stymo
