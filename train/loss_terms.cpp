#include "train/loss_terms.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <sstream>

#include "core/autograd/recompute.h"
#include "core/ops/ops.h"
#include "nn/known_pixels.h"
#include "nn/losses.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

/// The gradient is computed at once, so that the discriminator's graph is released before that of
/// the perceptual network is recorded.
Variable adversarial_term(const LossInputs& in, LossValues&) {
    const double fade = in.position.fade;
    return differentiate_at_once(
        [&](const Variable& images) {
            return generator_loss((*in.discriminator)(
                augmented(faded_image(seen_by_discriminator(images, in.batch), fade),
                          in.augmentations),
                fade));
        },
        in.decoded.images.back());
}

Variable reconstruction_term(const LossInputs& in, LossValues& values) {
    const ReconstructionLoss::Terms terms = in.reconstruction(
        in.decoded.images,
        in.reconstruction.target(in.batch.targets, in.position.phase.resolution, in.batch.known));
    values["photometric"] = terms.photometric.value().item();
    if (terms.perceptual.defined()) values["perceptual"] = terms.perceptual.value().item();
    return terms.total;
}

Variable mask_term(const LossInputs& in, LossValues&) {
    return mask_loss(in.decoded.mask_logit, in.batch.mask, in.batch.known);
}

Variable opacity_term(const LossInputs& in, LossValues&) {
    return opacity_error(in.decoded, in.batch);
}

Variable depth_variance_term(const LossInputs& in, LossValues&) {
    return depth_variance(in.decoded.weights.weights, in.decoded.samples.depths);
}

/// How far the first faces of the batch, rendered from `cameras`, are from the people in the photos
/// that their identity is read from. The gradient is computed at once, as for the adversarial term.
Variable identity_distance(const LossInputs& in, const Variable& images,
                           std::span<const Camera> cameras) {
    const FaceBatch& batch = in.batch;
    const bool reads_others = batch.other_input.defined();
    const Variable photos(reads_others ? batch.other_input : batch.input);
    const std::span<const Camera> seen_by(reads_others ? batch.other_cameras : batch.cameras);
    const CameraConfig& model = in.config.model.camera;
    const Tensor read = slice(photos, 0, 0, images.shape(0)).value();
    return differentiate_at_once(
        [&](const Variable& rendered) {
            return in.identity->distance(rendered, ffhq_frames(cameras, model), read,
                                         ffhq_frames(seen_by.first(cameras.size()), model));
        },
        images);
}

Variable identity_term(const LossInputs& in, LossValues&) {
    return identity_distance(in, in.decoded.images.back(), in.batch.cameras);
}

/// Further faces, rendered beside those of the batch.
Variable faces_aside(const LossInputs& in, const Codes& codes, const std::vector<Camera>& cameras) {
    const Decoder& decoder = in.model.decoder();
    return decoder(codes, cameras,
                   {.samples_per_ray = in.position.phase.samples_per_ray,
                    .resolution = aside_side(decoder.ladder(), in.position.phase),
                    .gradient_tolerance = in.config.optimizer.sample_tolerance})
        .images.back();
}

/// The first half of the faces is also seen from one side or the other, where photos show little.
Variable side_identity_term(const LossInputs& in, LossValues&) {
    constexpr double side_yaw = 0.5;
    const std::int64_t half = std::max<std::int64_t>(in.codes.batch() / 2, 1);
    Codes codes;
    for (std::size_t group = 0; group < codes.groups.size(); ++group)
        codes.groups[group] = slice(in.codes.groups[group], 0, 0, half);
    std::vector<Camera> cameras;
    for (std::int64_t row = 0; row < half; ++row) {
        const bool left = (in.position.step + row) % 2 == 0;
        cameras.push_back(model_camera(in.model, left ? -side_yaw : side_yaw, 0.0, 0.0));
    }
    return identity_distance(in, faces_aside(in, codes, cameras), cameras);
}

/// The least change that an expression counts as, a part of the mean square of the codes. Two
/// expressions that have nothing to do with each other differ by about twice that mean.
constexpr double expression_floor = 0.2;

/// The first half of the faces gets the expressions of the second. What the encoder sees of them
/// differs from what was asked for by this part of what was asked to change.
Variable expression_term(const LossInputs& in, LossValues&) {
    const std::int64_t half = in.codes.batch() / 2;
    if (half == 0) return Tensor::zeros({}, in.decoded.images.back().dtype());
    const auto rows = [&](std::size_t group, std::int64_t begin) {
        return slice(in.codes.groups[group], 0, begin, begin + half);
    };
    const Codes mixed{{rows(0, 0), rows(1, half), rows(2, 0), rows(3, 0)}};
    const std::vector<Camera> cameras(in.batch.cameras.begin(), in.batch.cameras.begin() + half);
    const Variable seen = in.model.encoder().expression(
        augmented(faces_aside(in, mixed, cameras), ffhq_frames(cameras, in.config.model.camera)));
    const Variable asked = mean(square(rows(1, half) - rows(1, 0)));
    // Two expressions that are alike ask for nothing; without a floor their noise is all that
    // counts.
    const Variable size = mean(square(in.codes.groups[1]));
    return mean(square(seen - rows(1, half))) / (asked + expression_floor * size + 1e-12);
}

Variable code_term(const LossInputs& in, LossValues&) {
    return code_loss(in.codes, in.batch.codes,
                     std::span<const double, 4>(in.config.loss.code_weights),
                     in.batch.code_present);
}

Variable code_norm_term(const LossInputs& in, LossValues&) {
    return squared_length(in.codes) / static_cast<double>(in.codes.batch() * code_size);
}

/// A weight of the configuration that both stages use.
template <double LossConfig::*weight>
double configured(const LossInputs& in) {
    return in.config.loss.*weight;
}

/// In the second stage the codes are constants.
bool codes_learn(const LossInputs& in) {
    return in.position.phase.stage == 1;
}

}  // namespace

Variable seen_by_discriminator(const Variable& images, const FaceBatch& batch) {
    return where_known(known_at(batch.known, images.shape(1), images.shape(2)), images, -1.0);
}

std::int64_t aside_side(const ResolutionLadder& ladder, const TrainingPhase& phase) {
    return ladder.largest_within(std::min<std::int64_t>(phase.resolution, 128));
}

std::span<const LossTerm> loss_terms() {
    static const std::vector<LossTerm> terms{
        {.name = "adversarial",
         .weight =
             [](const LossInputs& in) {
                 return in.position.phase.stage == 2 ? in.config.loss.adversarial_weight : 0.0;
             },
         .value = adversarial_term,
         .second_stage_alone = true},
        {.name = "reconstruction",
         .weight = [](const LossInputs&) { return 1.0; },
         .value = reconstruction_term,
         .parts = {"photometric", "perceptual"}},
        {.name = "mask",
         .weight =
             [](const LossInputs& in) {
                 return in.decoded.mask_logit.defined() ? in.config.loss.mask_weight : 0.0;
             },
         .value = mask_term},
        {.name = "opacity",
         .weight = configured<&LossConfig::opacity_weight>,
         .value = opacity_term},
        {.name = "depth_variance",
         .weight = configured<&LossConfig::depth_variance_weight>,
         .value = depth_variance_term},
        {.name = "identity",
         .weight = configured<&LossConfig::identity_weight>,
         .value = identity_term},
        {.name = "side_identity",
         .weight =
             [](const LossInputs& in) {
                 return codes_learn(in) ? in.config.loss.side_identity_weight : 0.0;
             },
         .value = side_identity_term},
        {.name = "expression",
         .weight =
             [](const LossInputs& in) {
                 return codes_learn(in) ? in.config.loss.expression_weight : 0.0;
             },
         .value = expression_term},
        // The function itself applies the weights of the four groups.
        {.name = "code",
         .weight =
             [](const LossInputs& in) {
                 return codes_learn(in) && in.batch.has_codes() ? 1.0 : 0.0;
             },
         .value = code_term},
        {.name = "code_norm",
         .weight =
             [](const LossInputs& in) {
                 return codes_learn(in) ? in.config.loss.code_norm_weight : 0.0;
             },
         .value = code_norm_term},
    };
    return terms;
}

std::vector<std::string_view> loss_names(int stage) {
    std::vector<std::string_view> names;
    for (const LossTerm& term : loss_terms()) {
        if (term.second_stage_alone && stage == 1) continue;
        names.push_back(term.name);
        std::ranges::copy(term.parts, std::back_inserter(names));
    }
    names.push_back(significant_share);
    return names;
}

double LossValues::operator[](std::string_view name) const {
    const auto found = std::ranges::find(values_, name, &std::pair<std::string, double>::first);
    return found == values_.end() ? 0.0 : found->second;
}

double& LossValues::operator[](std::string_view name) {
    const auto found = std::ranges::find(values_, name, &std::pair<std::string, double>::first);
    return found == values_.end() ? values_.emplace_back(name, 0.0).second : found->second;
}

void LossValues::accumulate(const LossValues& other, double part) {
    total += part * other.total;
    for (const auto& [name, value] : other.values_) (*this)[name] += part * value;
}

std::string LossValues::text() const {
    std::ostringstream text;
    const auto bits = [](double value) { return std::bit_cast<std::uint64_t>(value); };
    text << "total " << bits(total);
    for (const auto& [name, value] : values_) text << ' ' << name << ' ' << bits(value);
    return text.str();
}

LossValues LossValues::parse(const std::string& text) {
    LossValues values;
    std::istringstream words(text);
    std::string name;
    std::uint64_t bits = 0;
    words >> name >> bits;
    values.total = std::bit_cast<double>(bits);
    while (words >> name >> bits) values[name] = std::bit_cast<double>(bits);
    return values;
}

}  // namespace stymo
