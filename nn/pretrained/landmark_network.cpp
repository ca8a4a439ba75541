#include "nn/pretrained/landmark_network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/ops.h"

namespace stymo {
namespace {

constexpr double landmark_slope = 0.1;
constexpr std::array<std::int64_t, 4> level_widths{24, 48, 96, 128};
static_assert(LandmarkFeatures::last_layer_count == (LandmarkFeatures::input_side / 16) *
                                                        (LandmarkFeatures::input_side / 16) *
                                                        level_widths.back());
constexpr std::int64_t coordinate_count = 136;
constexpr const char* landmark_prefix = "landmarks.";
constexpr const char* landmark_format_key = "format";
constexpr const char* landmark_format = "stymo landmark network 1";
/// The result for the detector's box is rough; after three squares it does not change any more.
constexpr int squares_in_turn = 4;
/// Scales of the last square, whose results are averaged.
constexpr std::array<double, 3> last_scales{0.94, 1.0, 1.06};

ConvLayer landmark_layer(ParameterStore& store, const std::string& name, std::int64_t in,
                         std::int64_t out, int stride, double deviation_factor, Rng& rng) {
    const double deviation = deviation_factor * std::sqrt(2.0 / static_cast<double>(9 * in));
    return {store, name, in, out, {.stride = stride, .padding = 1, .initial_deviation = deviation},
            rng};
}

Tensor batch_of(const std::vector<Tensor>& images) {
    Tensor batch({static_cast<std::int64_t>(images.size()), images.front().shape(0),
                  images.front().shape(1), images.front().shape(2)});
    auto target = batch.mutable_values<float>().begin();
    for (const Tensor& image : images)
        target = std::ranges::copy(image.values<float>(), target).out;
    return batch;
}

}  // namespace

LandmarkFeatures::LandmarkFeatures(ParameterStore& store, const std::string& prefix, Rng& rng)
    : levels_(make_levels(store, prefix, rng)),
      hidden_(store, prefix + "hidden", last_layer_count, count,
              LinearOptions{.activation = Activation::leaky_relu}, rng) {}

std::vector<LandmarkFeatures::Level> LandmarkFeatures::make_levels(ParameterStore& store,
                                                                   const std::string& prefix,
                                                                   Rng& rng) {
    std::vector<Level> levels;
    std::int64_t in = 3;
    for (const std::int64_t out : level_widths) {
        const std::string name = prefix + "level" + std::to_string(levels.size());
        Level level{landmark_layer(store, name + ".down", in, out, 2, 1.0, rng), {}};
        if (in != 3) {
            level.pair.push_back(landmark_layer(store, name + ".first", out, out, 1, 1.0, rng));
            // A pair begins close to the identity.
            level.pair.push_back(landmark_layer(store, name + ".second", out, out, 1, 0.2, rng));
        }
        levels.push_back(std::move(level));
        in = out;
    }
    return levels;
}

Variable LandmarkFeatures::last_layer(const Variable& images) const {
    Variable x = unit_contrast(images);
    for (const Level& level : levels_) {
        x = level.down(x, landmark_slope);
        if (!level.pair.empty())
            x = x + level.pair[1](level.pair[0](x, landmark_slope), landmark_slope);
    }
    return reshape(x, {x.shape(0), -1});
}

LandmarkNetwork::LandmarkNetwork(ParameterStore& store, const std::string& prefix, Rng& rng)
    : features_(store, prefix, rng),
      points_(store, prefix + "points", LandmarkFeatures::count, coordinate_count,
              LinearOptions{.initial_weight_scale = 0.1}, rng) {}

LandmarkModel make_landmark_model(Rng rng) {
    auto store = std::make_shared<ParameterStore>();
    LandmarkNetwork network(*store, landmark_prefix, rng);
    return {.store = std::move(store), .network = std::move(network)};
}

namespace {

void read_covers(const std::filesystem::path& path, LandmarkModel& model) {
    const TensorFile file = read_tensor_file(path);
    const auto tensor = [&](const char* name, const Shape& shape) {
        const auto found = file.tensors.find(name);
        if (found == file.tensors.end() || found->second.shape() != shape)
            fail<FileError>(path.string(), ": not the covers of a landmark network");
        return found->second.to(DType::float32);
    };
    model.cover_weight = tensor("covers.weight", {2, LandmarkNetwork::feature_count});
    model.cover_bias = tensor("covers.bias", {2});
}

/// The mean over images.
FaceCovers covers_in(const LandmarkModel& model, const Tensor& features) {
    if (!model.cover_weight.defined()) return {};
    const Variable each =
        matmul(features, model.cover_weight, {.transpose_b = true}) + Variable(model.cover_bias);
    const std::vector<double> logits = mean(each, {0}).value().to_vector();
    return {logits[0], logits[1]};
}

}  // namespace

LandmarkModel read_landmark_model(const std::filesystem::path& path) {
    const TensorFile file = read_tensor_file(path);
    const auto found = file.metadata.find(landmark_format_key);
    if (found == file.metadata.end() || found->second != landmark_format)
        fail<FileError>(path.string(), ": not a landmark network of stymo");
    LandmarkModel model = make_landmark_model(Rng(0));
    model.store->load(file, path.string());
    model.store->set_trainable("", false);
    const std::filesystem::path covers = path.parent_path() / "covers.safetensors";
    if (std::filesystem::exists(covers)) read_covers(covers, model);
    return model;
}

void write_landmark_model(const std::filesystem::path& path, const LandmarkModel& model) {
    TensorFile file;
    file.metadata[landmark_format_key] = landmark_format;
    model.store->save(file);
    write_tensor_file(path, file);
}

namespace {

FacePoints points_seen(const LandmarkModel& model, const Tensor& photo,
                       const std::vector<FaceSquare>& squares,
                       const std::optional<Midline>& midline, FaceCovers* covers = nullptr) {
    std::vector<Tensor> images;
    for (const FaceSquare& square : squares) {
        images.push_back(image_in_square(photo, square, LandmarkNetwork::input_side, midline));
        images.push_back(mirror_image(images.back()));
    }
    const Variable features = model.network.features(batch_of(images));
    if (covers != nullptr) *covers = covers_in(model, features.value());
    const Variable answer = model.network.points(features);
    const auto values = answer.value().values<float>();
    FacePoints points;
    points.fill(Eigen::Vector2d::Zero());
    for (std::size_t image = 0; image < images.size(); ++image)
        for (std::size_t k = 0; k < points.size(); ++k) {
            const bool mirrored = image % 2 == 1;
            const std::size_t at =
                image * coordinate_count + 2 * (mirrored ? mirrored_point(k) : k);
            const auto x = static_cast<double>(values[at]);
            const auto y = static_cast<double>(values[at + 1]);
            points[k] += squares[image / 2].point({mirrored ? -x : x, y}) /
                         static_cast<double>(images.size());
        }
    return points;
}

/// Whether the photo cuts the face off.
bool is_cut(const FacePoints& points, const Tensor& photo) {
    return std::ranges::any_of(points, [&](const Eigen::Vector2d& point) {
        return point.minCoeff() < 0.0 || point.x() > static_cast<double>(photo.shape(1)) ||
               point.y() > static_cast<double>(photo.shape(0));
    });
}

}  // namespace

FacePoints points_in_squares(const LandmarkModel& model, const Tensor& photo,
                             const std::vector<FaceSquare>& squares) {
    return points_seen(model, photo, squares, std::nullopt);
}

FacePoints find_points(const LandmarkModel& model, const Tensor& photo, const FaceSquare& start,
                       FaceCovers* covers) {
    // The network has not learnt what a cut face looks like, so it sees the mirror image there:
    // from the start where a side is missing, because the rest looks like a narrow face.
    constexpr double part_of_face = 0.77;
    const double reach = part_of_face * start.axis.norm();
    std::optional<Midline> midline;
    if (start.center.x() < reach || start.center.x() + reach > static_cast<double>(photo.shape(1)))
        midline = Midline{start.center, start.axis.normalized()};
    FacePoints points = points_seen(model, photo, {start}, midline);
    for (int turn = 2; turn < squares_in_turn; ++turn)
        points = points_seen(model, photo, {square_around(points)}, midline);
    constexpr int turns_of_a_cut_face = 4;
    for (int turn = 0; turn < turns_of_a_cut_face && (midline || is_cut(points, photo)); ++turn) {
        midline = midline_of(points);
        points = points_seen(model, photo, {square_around(points)}, midline);
    }
    std::vector<FaceSquare> last;
    for (const double scale : last_scales) {
        last.push_back(square_around(points));
        last.back().axis *= scale;
    }
    return points_seen(model, photo, last, midline, covers);
}

}  // namespace stymo
