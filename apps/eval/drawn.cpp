#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <numeric>
#include <sstream>
#include <vector>

#include "apps/common/tool_options.h"
#include "apps/eval/commands.h"
#include "apps/eval/evaluate.h"
#include "apps/eval/person_measures.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "fit/fit_report.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

using Features = std::vector<std::vector<double>>;

double kernel(const std::vector<double>& x, const std::vector<double>& y) {
    const double dot = std::inner_product(x.begin(), x.end(), y.begin(), 0.0);
    const double base = dot / static_cast<double>(x.size()) + 1.0;
    return base * base * base;
}

/// Mean of the kernel over the pairs of different features.
double mean_within(const Features& set) {
    double sum = 0.0;
    for (std::size_t i = 0; i < set.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) sum += 2.0 * kernel(set[i], set[j]);
    const auto count = static_cast<double>(set.size());
    return sum / (count * (count - 1.0));
}

double mean_between(const Features& a, const Features& b) {
    double sum = 0.0;
    for (const std::vector<double>& x : a)
        for (const std::vector<double>& y : b) sum += kernel(x, y);
    return sum / (static_cast<double>(a.size()) * static_cast<double>(b.size()));
}

}  // namespace

double kernel_distance(const Features& a, const Features& b) {
    if (a.size() < 2 || b.size() < 2)
        fail<ValueError>("a kernel distance needs at least two features of each set");
    for (const Features* set : {&a, &b})
        if (std::ranges::any_of(
                *set, [&](const std::vector<double>& x) { return x.size() != a.front().size(); }))
            fail<ValueError>("features of different lengths cannot be compared");
    return mean_within(a) + mean_within(b) - 2.0 * mean_between(a, b);
}

namespace {

/// Embeddings of photos, with the cameras that they were taken by.
struct Photos {
    Features features;
    std::vector<Camera> cameras;
};

/// The features of a face. Embeddings have unit length. The kernel expects numbers of about 1, or
/// it would compare little more than means.
std::vector<double> features_of(const IdentityMeasure& measure, const Tensor& image,
                                const Camera& camera, const CameraConfig& model) {
    std::vector<double> features = measure.embedding(image, camera, model);
    const double scale = std::sqrt(static_cast<double>(features.size()));
    for (double& value : features) value *= scale;
    return features;
}

Photos photos_of(const Model& model, const DrawnOptions& options, const IdentityMeasure& measure) {
    DataConfig data;
    data.cache_megabytes = 0;
    const Dataset faces(options.data, model.config().decoder.resolution, data, Split::all,
                        model.config().camera);
    EvaluationOptions selection;
    selection.range = parse_range(options.ids);
    Photos photos;
    for (const std::int64_t i : positions_of(faces, selection.range)) {
        try {
            const ComparedFace face = compared_face(model, faces, i, selection);
            const Camera& camera = face.batch.cameras.front();
            photos.features.push_back(features_of(measure, photo_with_guesses(face.batch), camera,
                                                  model.config().camera));
            photos.cameras.push_back(camera);
        } catch (const Error& error) {
            std::cerr << "skipped " << faces.files(i).id << ": " << error.what() << std::endl;
        }
    }
    constexpr std::size_t least = 4;
    if (photos.features.size() < least)
        fail<UsageError>("--ids: drawn faces are compared with at least ", least, " photos");
    return photos;
}

double distance_of_halves(const Features& features) {
    Features halves[2];
    for (std::size_t i = 0; i < features.size(); ++i) halves[i % 2].push_back(features[i]);
    return kernel_distance(halves[0], halves[1]);
}

}  // namespace

AppResult evaluate_drawn(const DrawnOptions& options, std::uint64_t seed) {
    for (const auto& [name, path] :
         {std::pair{"--data", options.data}, std::pair{"--identity", options.identity}})
        if (path.empty()) fail<UsageError>(name, " is required");
    if (!options.sheet.empty()) {
        require_extension(options.sheet, {".png", ".jpg"});
        require_folder_of(options.sheet);
    }
    const Model model = load_model(options.model, ModelParts::decoder);
    if (!model.code_statistics())
        fail<ValueError>(model_file(options.model).string(),
                         ": has no statistics of codes to draw faces from");
    const IdentityMeasure measure(options.identity);
    const Photos photos = photos_of(model, options, measure);

    const ViewOptions view{.samples_per_ray = model.config().reconstruction.fit_samples_per_ray};
    const Rng rng(seed);
    Features drawn;
    std::vector<Tensor> tiles;
    constexpr std::size_t most_tiles = 32;
    const InterruptGuard guard;
    Progress progress({.title = "draw", .total = options.count, .unit = "faces"});
    for (std::int64_t i = 0; i < options.count; ++i) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        Rng own = rng.split(static_cast<std::uint64_t>(i));
        const Codes codes = model.code_statistics()->sample(own, options.truncation);
        const Camera& camera = photos.cameras[static_cast<std::size_t>(i) % photos.cameras.size()];
        const Tensor image = render_view(model, codes, 0, camera, view).image;
        drawn.push_back(features_of(measure, image, camera, model.config().camera));
        if (tiles.size() < most_tiles) tiles.push_back(image);
        progress.update(i + 1, "");
    }
    progress.finish();
    constexpr int columns = 8;
    if (!options.sheet.empty()) write_image(options.sheet, tile_images(tiles, columns));

    const double distance = kernel_distance(drawn, photos.features);
    const double halves = distance_of_halves(photos.features);
    std::ostringstream text;
    text << std::fixed << std::setprecision(5) << "KID with features of MobileFaceNet: " << distance
         << " (" << drawn.size() << " drawn faces, truncation " << std::defaultfloat
         << options.truncation << ", and " << photos.features.size() << " photos); " << std::fixed
         << halves << " between two halves of the photos\n";
    return {text.str(), JsonValue::object({{"kid", distance},
                                           {"kid_of_photos", halves},
                                           {"features", "MobileFaceNet"},
                                           {"drawn", drawn.size()},
                                           {"photos", photos.features.size()},
                                           {"truncation", options.truncation}})};
}

}  // namespace stymo
