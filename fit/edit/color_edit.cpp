#include "fit/edit/color_edit.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "nn/losses.h"
#include "nn/models/display_image.h"
#include "nn/optim/adam.h"

namespace stymo {

namespace {

/// Largest distances in L, a, b from the colour of the point for close colours. Shading changes
/// lightness more than hue.
const cv::Scalar close_in_lab(18.0, 7.0, 7.0);
/// Radius of the blur that smooths hair and noise before colours are compared, as a share of the
/// image's side.
constexpr double blur_share = 1.0 / 64.0;

constexpr std::size_t texture = 2;  ///< its index in `code_names`

Tensor as_batch(const Tensor& image) {
    return image.reshaped({1, image.shape(0), image.shape(1), image.shape(2)});
}

/// Sum over RGB of the mean under the mask of squared differences.
Variable squared_distance(const Variable& image, const Variable& other, const Tensor& mask) {
    return sum(masked_mean(square(image - other), mask));
}

/// L_color.
Variable color_loss(const Variable& image, const Variable& wanted, const Tensor& part,
                    ColorTerm term) {
    if (term == ColorTerm::pixels) return squared_distance(image, wanted, part);
    return sum(square(masked_mean(image - wanted, part)));
}

/// An image of one colour, in the decoder's range.
Variable plain(const Eigen::Vector3d& color, const Shape& shape, DType dtype) {
    const Tensor pixel =
        Tensor::from({1, 1, 1, 3}, std::span<const double>(color.data(), 3)).to(dtype);
    return broadcast_to(Variable(pixel) * 2.0 - 1.0, shape);
}

}  // namespace

Tensor part_mask(const Tensor& classes, const ParsingClassSet& parts) {
    Tensor mask(classes.shape());
    std::ranges::transform(
        classes.values<float>(), mask.mutable_values<float>().begin(),
        [&](float part) { return parts[static_cast<std::size_t>(part)] ? 1.0F : 0.0F; });
    return mask;
}

ParsingClassSet head_of_parts() {
    ParsingClassSet parts{};
    for (std::size_t part = 0; part < parts.size(); ++part)
        parts[part] = is_head_class(static_cast<int>(part));
    return parts;
}

Tensor region_at(const Tensor& image, double x, double y, double reach) {
    if (image.rank() != 3 || image.shape(0) != image.shape(1) || image.shape(2) != 3)
        fail<ShapeError>("[region_at] needs (S, S, 3), got ", image.shape());
    if (!(x >= 0.0 && x <= 1.0 && y >= 0.0 && y <= 1.0))
        fail<ValueError>("the point (", x, ", ", y, ") is outside the image");
    if (!(reach > 0.0)) fail<ValueError>("the reach must be positive, got ", reach);
    const int side = static_cast<int>(image.shape(0));
    Tensor pixels = image;
    const cv::Mat rgb(side, side, CV_32FC3, pixels.mutable_values<float>().data());
    cv::Mat lab;
    cv::cvtColor(rgb, lab, cv::COLOR_RGB2Lab);
    cv::GaussianBlur(lab, lab, {}, std::max(0.5, blur_share * side));
    const cv::Point seed(std::min(static_cast<int>(x * side), side - 1),
                         std::min(static_cast<int>(y * side), side - 1));
    cv::Mat mask = cv::Mat::zeros(side + 2, side + 2, CV_8U);
    const cv::Scalar range = close_in_lab * reach;
    constexpr int filled = 1 << 8;
    cv::floodFill(lab, mask, seed, {}, nullptr, range, range,
                  4 | cv::FLOODFILL_MASK_ONLY | cv::FLOODFILL_FIXED_RANGE | filled);
    Tensor result({side, side, 1});
    const std::span<float> values = result.mutable_values<float>();
    for (int row = 0; row < side; ++row) {
        for (int column = 0; column < side; ++column)
            values[static_cast<std::size_t>(row) * static_cast<std::size_t>(side) +
                   static_cast<std::size_t>(column)] =
                mask.at<std::uint8_t>(row + 1, column + 1) != 0 ? 1.0F : 0.0F;
    }
    return result;
}

void keep_near_faces(const Model& model, ColorEditOptions& options) {
    if (!model.code_statistics()) return;
    constexpr double step = 0.1, regularizer = 0.03;
    const std::vector<double> factor = model.code_statistics()->factor().to_vector();
    double variance = 0.0;
    const std::int64_t first = code_sizes[0] + code_sizes[1];
    for (std::int64_t i = first * code_size; i < (first + code_sizes[texture]) * code_size; ++i)
        variance += factor[static_cast<std::size_t>(i)] * factor[static_cast<std::size_t>(i)];
    if (!(variance > 0.0)) return;
    options.learning_rate = step * std::sqrt(variance / static_cast<double>(code_sizes[texture]));
    options.regularizer = regularizer / variance;
}

ColorObjective::ColorObjective(const Model& model, const Codes& codes, const Camera& camera,
                               const Tensor& part, const Eigen::Vector3d& color,
                               const ColorEditOptions& options)
    : model_(model),
      codes_(codes),
      decode_{.samples_per_ray = options.samples_per_ray > 0
                                     ? options.samples_per_ray
                                     : model.config().reconstruction.fit_samples_per_ray},
      term_(options.term),
      rest_weight_(options.rest_weight),
      regularizer_(options.regularizer < 0.0 ? model.config().reconstruction.fit_regularizer
                                             : options.regularizer) {
    const Decoded face = model.decoder()(codes, {camera}, decode_);
    feature_map_ = face.feature_map.detach();
    original_ = face.images.back().detach();
    const DType dtype = original_.dtype();
    part_ = as_batch(part).to(dtype);
    const std::vector<double> covered = part_.to_vector();
    if (std::ranges::none_of(covered, [](double value) { return value > 0.0; }))
        fail<ValueError>("colour editing: the part has no pixels");
    rest_ = affine(Variable(part_), -1.0, 1.0).value();
    wanted_ = plain(color, original_.shape(), dtype);
}

Codes ColorObjective::codes(const Variable& offset) const {
    Codes edited = codes_;
    edited.groups[texture] = codes_.texture() + offset;
    return edited;
}

Variable ColorObjective::image(const Variable& offset) const {
    const Decoder& decoder = model_.decoder();
    return decoder.decode_feature_map(feature_map_, decoder.map(codes(offset)), decode_)
        .images.back();
}

Variable ColorObjective::loss(const Variable& offset) const {
    for (const char* term : {"color", "rest", "regularizer"})
        work::count_named("loss_terms", term, 1);
    const Variable edited = image(offset);
    return color_loss(edited, wanted_, part_, term_) +
           squared_distance(edited, original_, rest_) * rest_weight_ +
           sum(square(offset)) * regularizer_;
}

ColorEdit edit_color(const Model& model, const Codes& codes, const Camera& camera,
                     const Tensor& part, const Eigen::Vector3d& color,
                     const ColorEditOptions& options) {
    const ColorObjective objective(model, codes, camera, part, color, options);
    ParameterStore store;
    const Parameter offset = store.create(
        "offset.tex", Tensor::zeros(codes.texture().shape(), objective.original().dtype()));
    ColorEdit edit;
    Adam adam;
    double learning_rate = options.learning_rate;
    for (std::int64_t step = 0; step < options.steps && !interrupted(); ++step) {
        const Variable loss = objective.loss(offset.variable());
        edit.losses.push_back(loss.value().item());
        if (!std::isfinite(edit.losses.back()))
            fail<NumericError>("colour editing, step ", step,
                               ": the loss is not finite; lower the learning rate");
        adam.step(store.all(), grad(loss, variables_of(store.all())), learning_rate);
        learning_rate *= options.decay;
        if (options.on_step) options.on_step(step + 1, edit.losses.back());
    }
    edit.codes = detached(objective.codes(offset.variable()));
    edit.before = display_image(objective.original().value(), 0);
    edit.after = display_image(objective.image(offset.variable()).value(), 0);
    return edit;
}

Eigen::Vector3d mean_color(const Tensor& image, const Tensor& mask) {
    const std::vector<double> mean =
        masked_mean(Variable(as_batch(image)), as_batch(mask.to(image.dtype())))
            .value()
            .to_vector();
    return Eigen::Vector3d(mean.data());
}

double mean_difference(const Tensor& a, const Tensor& b, const Tensor& mask) {
    return mean(masked_mean(abs(Variable(as_batch(a)) - Variable(as_batch(b))),
                            as_batch(mask.to(a.dtype()))))
        .value()
        .item();
}

double share_of_way(const Eigen::Vector3d& before, const Eigen::Vector3d& after,
                    const Eigen::Vector3d& target) {
    const double whole = (target - before).norm();
    return whole > 0.0 ? 1.0 - (target - after).norm() / whole : 1.0;
}

}  // namespace stymo
