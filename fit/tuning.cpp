#include "fit/tuning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>

#include "core/angle.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "fit/head_depth.h"
#include "nn/models/significant_rows.h"
#include "nn/optim/muon.h"
#include "nn/realtime/view.h"
#include "render/turned_photo.h"

namespace stymo {

namespace {

/// Share of the time in which the learning rate rises.
constexpr double rising = 0.05;
/// Tuning takes few steps. Muon's usual momentum of 0.95 averages over about twenty of them, which
/// is too many.
constexpr double momentum = 0.7;
/// Factors on the learning rate. The field gets less, because a single photo does not determine its
/// shape; so do parameters that Adam moves, because equally large changes of them blur the image.
constexpr double field_factor = 0.1, adam_factor = 0.1;
constexpr std::string_view field_prefix = "decoder.field.";
/// Every so many steps an anchor is compared too.
constexpr std::int64_t anchor_interval = 3;
/// The first of every so many comparisons with a photo or an anchor evaluates all samples. The
/// others evaluate only those that were significant in it.
constexpr std::int64_t selection_interval = 8;
constexpr double largest_yaw = 40.0, largest_pitch = 15.0;

/// A view that the tuned decoder is compared with, beside the photo.
struct Anchor {
    std::int64_t row;  ///< of the face
    bool shows_face;   ///< else one with a neighbouring code
    Codes codes;
    Camera camera;
    std::vector<Tensor> images;            ///< target, in ascending order of sides
    std::optional<FaceSurface> surface{};  ///< what the depth is drawn to
    std::int64_t comparisons = 0;
    Tensor significant{};  ///< as for a photo
};

class Tuning {
public:
    Tuning(const Model& original, Model& tuned, const ReconstructionLoss& loss,
           const FaceBatch& faces, const Codes& codes, const std::vector<Camera>& cameras,
           const TuningOptions& options)
        : original_(original),
          tuned_(tuned),
          loss_(loss),
          faces_(faces),
          codes_(codes),
          cameras_(cameras),
          options_(options),
          samples_per_ray_(options.samples_per_ray > 0
                               ? options.samples_per_ray
                               : tuned.config().reconstruction.fit_samples_per_ray),
          heads_(options.weights.depth > 0.0 ? options.head : nullptr, faces) {
        for (std::int64_t i = 0; i < codes.batch(); ++i) {
            std::vector<Tensor> images;
            for (const Tensor& images_of_all : faces.targets)
                images.push_back(slice(Variable(images_of_all), 0, i, i + 1).value());
            photos_.push_back(loss.kept_target(images, faces.known_of(i)));
            weigh_largest(photos_.back().weights, images.size(), original.decoder());
            look_at_photo(i);
            if (options.weights.identity > 0.0 && original.has_encoder() &&
                original.encoder().knows_faces())
                embeddings_.push_back(face_embeddings(original, photos_.back().images.back(),
                                                      {&cameras_[static_cast<std::size_t>(i)], 1},
                                                      faces.known_of(i))
                                          .value());
        }
        significant_.resize(photos_.size());
        tuned.parameters().set_trainable("", false);
        for (const std::string_view prefix : {field_prefix, {"decoder.block"}, {"decoder.mask."}})
            tuned.parameters().set_trainable(prefix, true);
        parameters_ = tuned.parameters().trainable();
    }

    struct Step {
        double loss = 0.0;  ///< of the photo, before the step
        TermValues terms;
    };
    Step step(std::int64_t number, double learning_rate) {
        const bool anchored = options_.anchors > 0 && options_.weights.locality > 0.0 &&
                              number % anchor_interval == anchor_interval - 1;
        std::array<double, 2> values{};
        std::array<TermValues, 2> terms;
        std::array<std::vector<Variable>, 2> gradients;
        // Only photo_loss changes `significant_`, and only anchor_loss `rng_` and `anchors_`, so
        // that they can run side by side.
        parallel_tasks(anchored ? 2 : 1, [&](std::int64_t task) {
            const auto which = static_cast<std::size_t>(task);
            FitLoss loss = which == 0 ? photo_loss(number) : anchor_loss(number / anchor_interval);
            values[which] = loss.total.value().item();
            terms[which] = std::move(loss.terms);
            gradients[which] = grad(loss.total, variables_of(parameters_));
        });
        if (!std::isfinite(values[0] + values[1]))
            fail<NumericError>("tuning step ", number,
                               ": the loss is not finite; lower the learning rate");
        for (std::size_t i = 0; anchored && i < parameters_.size(); ++i)
            gradients[0][i] = gradients[0][i] + gradients[1][i];
        optimizer_.step(parameters_, gradients[0],
                        {learning_rate, field_prefix, field_factor, adam_factor});
        return {values[0], std::move(terms[0])};
    }

private:
    [[nodiscard]] DecodeOptions decoding(std::int64_t resolution, bool mask = false) const {
        return {.samples_per_ray = samples_per_ray_,
                .resolution = resolution,
                .mask = mask,
                .gradient_tolerance = options_.tolerance,
                .keep_field = true};
    }

    [[nodiscard]] FitLoss photo_loss(std::int64_t number) {
        const std::int64_t row = number % codes_.batch();
        const auto index = static_cast<std::size_t>(row);
        const ReconstructionLoss::Target& photo = photos_[index];
        const std::int64_t side = tuned_.decoder().ladder().largest();
        // The mask branch reads features of the render blocks, which tuning changes.
        const bool masked = faces_.has_mask_of(row) && faces_.mask.shape(1) == side;
        DecodeOptions decode = decoding(side, masked);
        const bool all = number / codes_.batch() % selection_interval == 0;
        if (!all) decode.significant_samples = significant_[index];
        Decoded decoded = tuned_.decoder()(codes_of_face(codes_, row), {cameras_[index]}, decode);
        decoded.images.resize(photo.images.size());  // a photo of few pixels has fewer
        if (all)
            significant_[index] =
                significant_samples(decoded.weights.weights.value(), options_.tolerance);
        FitComparison seen{.decoded = decoded, .reconstruction = &loss_, .photos = &photo};
        if (masked) {
            seen.mask = slice(Variable(faces_.mask), 0, row, row + 1).value();
            seen.known = faces_.known_of(row);
        }
        return loss_of(seen, surfaces_[index], row);
    }

    [[nodiscard]] FitLoss anchor_loss(std::int64_t number) {
        const std::int64_t index = number % options_.anchors;
        if (index == std::ssize(anchors_)) anchors_.push_back(make_anchor(index));
        Anchor& anchor = anchors_[static_cast<std::size_t>(index)];
        DecodeOptions decode = decoding(anchor.images.back().shape(1));
        const bool all = anchor.comparisons++ % selection_interval == 0;
        if (!all) decode.significant_samples = anchor.significant;
        const Decoded decoded = tuned_.decoder()(anchor.codes, {anchor.camera}, decode);
        if (all)
            anchor.significant =
                significant_samples(decoded.weights.weights.value(), options_.tolerance);
        std::vector<double> weights = original_.config().reconstruction.resolution_weights;
        weigh_largest(weights, anchor.images.size(), original_.decoder());
        FitComparison seen{
            .decoded = decoded, .kept_images = anchor.images, .kept_weights = weights};
        if (anchor.shows_face && !embeddings_.empty()) {
            seen.side_embeddings =
                face_embeddings(original_, decoded.images.back(), {&anchor.camera, 1});
            seen.photo_embeddings = embeddings_[static_cast<std::size_t>(anchor.row)];
        }
        return loss_of(seen, anchor.surface, anchor.row);
    }

    /// The loss of a comparison, which also gets the depth of the face of this row.
    [[nodiscard]] FitLoss loss_of(FitComparison seen, const std::optional<FaceSurface>& surface,
                                  std::int64_t row) const {
        if (surface) seen.depths = expected_depth(seen.decoded);
        seen.surfaces = {&surface, 1};
        seen.heads = &heads_;
        seen.first_row = row;
        return fit_loss(seen, options_.weights);
    }

    [[nodiscard]] Anchor make_anchor(std::int64_t number) {
        const bool neighbour = number % 3 == 0;
        const std::int64_t row = number / 3 % codes_.batch();
        Anchor anchor{row, !neighbour, codes_of_face(codes_, row), {}, {}};
        if (neighbour) anchor.codes = add(anchor.codes, random_offset());
        const double yaw = rng_.uniform(-largest_yaw, largest_yaw);
        const double pitch = rng_.uniform(-largest_pitch, largest_pitch);
        anchor.camera =
            model_camera(original_, radians_from_degrees(yaw), radians_from_degrees(pitch), 0.0);
        const Decoder& decoder = original_.decoder();
        if (neighbour) {
            const Decoded decoded =
                decoder(anchor.codes, {anchor.camera}, decoding(decoder.ladder().largest()));
            for (const Variable& image : decoded.images) anchor.images.push_back(image.value());
        } else {
            show_from_the_side(anchor);
        }
        return anchor;
    }

    /// The face rendered by the original decoder, in the range of its images.
    [[nodiscard]] SeenFace seen_face(std::int64_t row, const Camera& camera, std::int64_t side,
                                     bool mask) const {
        const View view = render_view(
            original_, codes_, row, camera,
            {.samples_per_ray = samples_per_ray_, .resolution = side, .mask = mask, .depth = true});
        return {camera, affine(Variable(view.image), 2.0, -1.0).value(), view.mask, view.depth};
    }

    /// The photo's colours and mask, with the depth map of the original decoder and, on the face,
    /// the depth of the linear head.
    void look_at_photo(std::int64_t row) {
        const Camera& camera = cameras_[static_cast<std::size_t>(row)];
        const Tensor& image = photos_.back().images.back();
        const std::int64_t side = image.shape(1);
        SeenFace seen = seen_face(row, camera, side, !faces_.mask.defined());
        seen.image = image.to(DType::float32).reshaped({side, side, 3});
        if (faces_.mask.defined())
            seen.mask = resize_box(slice(Variable(faces_.mask), 0, row, row + 1),
                                   static_cast<int>(side), static_cast<int>(side))
                            .value()
                            .to(DType::float32)
                            .reshaped({side, side, 1});
        heads_.align(row, camera, seen.depth);
        const auto surface = heads_.surface(row, camera, seen.depth.shape(0));
        if (surface) seen.depth = with_surface(seen.depth, *surface);
        surfaces_.push_back(heads_.surface(row, camera, tuned_.decoder().rays_per_side()));
        seen_.push_back(std::move(seen));
    }

    /// Sets the images of an anchor to the face from another side: the photo's colours where it
    /// shows the point, else those of the original decoder. They have the photo's sides, because
    /// its colours would be blurred at larger ones.
    void show_from_the_side(Anchor& anchor) const {
        const std::vector<std::int64_t>& sides = original_.decoder().ladder().sides();
        const std::size_t count = photos_[static_cast<std::size_t>(anchor.row)].images.size();
        SeenFace view = seen_face(anchor.row, anchor.camera, sides.back(), true);
        const auto surface = heads_.surface(anchor.row, anchor.camera, view.depth.shape(0));
        if (surface) view.depth = with_surface(view.depth, *surface);
        anchor.surface = heads_.surface(anchor.row, anchor.camera,
                                        original_.decoder().rays_per_side(sides[count - 1]));
        const Tensor image = turned_photo(seen_[static_cast<std::size_t>(anchor.row)], view).image;
        const Variable turned = Variable::leaf(image.reshaped({1, sides.back(), sides.back(), 3})
                                                   .to(photos_.front().images.back().dtype()));
        for (const std::int64_t side : std::span(sides).first(count))
            anchor.images.push_back(
                resize_box(turned, static_cast<int>(side), static_cast<int>(side)).value());
    }

    /// A random offset with the covariance of the code statistics, or isotropic for a model without
    /// statistics.
    [[nodiscard]] Codes random_offset() {
        const std::optional<CodeStatistics>& statistics = original_.code_statistics();
        constexpr double distance = 0.5;  // in standard deviations
        if (!statistics)
            return split_codes(Variable(rng_.normal({1, code_size}, 0.0, 0.1 * distance)));
        const Variable mean = reshape(Variable(statistics->mean()), {1, code_size});
        return split_codes(joined(statistics->sample(rng_, distance)) - mean);
    }

    const Model& original_;
    Model& tuned_;
    const ReconstructionLoss& loss_;
    const FaceBatch& faces_;
    const Codes& codes_;
    const std::vector<Camera>& cameras_;
    const TuningOptions& options_;
    std::int64_t samples_per_ray_;
    HeadDepth heads_;
    std::vector<std::optional<FaceSurface>> surfaces_;  ///< in the photos
    std::vector<SeenFace> seen_;                        ///< by the cameras of the photos
    std::vector<ReconstructionLoss::Target> photos_;
    std::vector<Tensor> embeddings_;   ///< of the photos; empty: they are not compared
    std::vector<Tensor> significant_;  ///< by photo: 1 for samples that are evaluated
    Rng rng_ = Rng(options_.seed).split("anchors");
    std::vector<Anchor> anchors_;  ///< those that were needed so far
    std::vector<Parameter> parameters_;
    HybridOptimizer optimizer_{{}, MuonScope::decoder, {.momentum = momentum}};
};

/// Finished share of the tuning.
double part_done(const TuningOptions& options, std::int64_t step, double seconds) {
    double part = 0.0;
    if (options.steps > 0) part = static_cast<double>(step) / static_cast<double>(options.steps);
    if (options.seconds > 0.0) part = std::max(part, seconds / options.seconds);
    return std::min(part, 1.0);
}

/// The largest learning rate for the number of steps that the finished ones predict. Before the
/// first step nothing predicts what a limit in seconds allows; then the limit in steps counts.
double highest_rate(const TuningOptions& options, std::int64_t step, double part) {
    if (options.learning_rate > 0.0) return options.learning_rate;
    if (part > 0.0) return usual_tuning_rate(static_cast<double>(step) / part);
    return usual_tuning_rate(std::max(static_cast<double>(options.steps), 1.0));
}

}  // namespace

double usual_tuning_rate(double steps) {
    constexpr double largest = 0.09, enough = 100.0;
    return largest * std::sqrt(std::min(1.0, steps / enough));
}

TuningResult tune_decoder(const Model& original, Model& tuned, const ReconstructionLoss& loss,
                          const FaceBatch& faces, const Codes& codes,
                          const std::vector<Camera>& cameras, const TuningOptions& options) {
    if (options.steps <= 0 && options.seconds <= 0.0)
        fail<ValueError>("tuning needs a limit, seconds or steps");
    const double start = seconds_now();
    Tuning tuning(original, tuned, loss, faces, codes, cameras, options);
    TuningResult result;
    for (std::int64_t step = 0; !interrupted(); ++step) {
        // The first step begins the schedule even if the preparation took all the time: at the end
        // of the half cosine it would learn nothing.
        const double part = step > 0 ? part_done(options, step, seconds_now() - start) : 0.0;
        if (part >= 1.0) break;
        const double rate = highest_rate(options, step, part) *
                            std::min(1.0, (part + 1e-3) / rising) * 0.5 *
                            (1.0 + std::cos(std::numbers::pi * part));
        Tuning::Step done = tuning.step(step, rate);
        result.losses.push_back(done.loss);
        result.terms = std::move(done.terms);
        if (options.on_step)
            options.on_step({step + 1, seconds_now() - start, result.losses.back()});
    }
    tuned.parameters().set_trainable("", false);
    result.seconds = seconds_now() - start;
    return result;
}

}  // namespace stymo
