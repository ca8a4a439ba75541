#include "train/tick.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <limits>
#include <sstream>
#include <string_view>
#include <utility>

#include "core/angle.h"
#include "core/clock.h"
#include "core/io/image.h"
#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/parallel.h"
#include "nn/known_pixels.h"
#include "nn/models/camera_problem.h"
#include "nn/models/display_image.h"
#include "nn/models/face_batch.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

constexpr std::int64_t faces_shown = 6;

std::vector<std::string_view> all_loss_names() {
    std::vector<std::string_view> names = loss_names(2);
    std::ranges::copy(discriminator_loss_names, std::back_inserter(names));
    return names;
}

}  // namespace

TickClock::TickClock(const TrainingImages& images, const Ranks& ranks, std::int64_t image)
    : images_(images), ranks_(ranks), begin_(reading(image)) {}

TickClock::Reading TickClock::reading(std::int64_t image) const {
    return {seconds_now(), ranks_.exchange_seconds(), ranks_.hidden_seconds(),
            images_.waiting_seconds(), image};
}

TickSpeed TickClock::lap(std::int64_t image, std::int64_t loading_threads) {
    const Reading begin = std::exchange(begin_, reading(image));
    const double seconds = begin_.now - begin.now;
    TickSpeed speed{static_cast<double>(image - begin.image) / seconds};
    if (ranks_.size() > 1) {
        const double hidden = begin_.hidden - begin.hidden;
        speed.hidden_exchange_share = hidden / seconds;
        speed.exchange_share = (begin_.exchange - begin.exchange - hidden) / seconds;
    }
    speed.disk_share =
        (begin_.disk - begin.disk) / (seconds * static_cast<double>(loading_threads));
    return speed;
}

void Tick::add(const StepReport& report) {
    if (report.non_finite) return;
    ++steps_;
    regularized_steps_ += report.regularized ? 1 : 0;
    learning_rate_ = report.learning_rate;
    losses_.accumulate(report.losses, 1.0);
}

LossValues Tick::losses() const {
    const auto mean_over = [](double sum, std::int64_t steps) {
        return sum / static_cast<double>(std::max<std::int64_t>(1, steps));
    };
    LossValues mean;
    if (steps_ == 0) {
        constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
        mean.total = unknown;
        for (const std::string_view name : all_loss_names()) mean[name] = unknown;
        return mean;
    }
    mean.accumulate(losses_, 1.0 / static_cast<double>(steps_));
    mean["r1"] = mean_over(losses_["r1"], regularized_steps_);
    return mean;
}

std::string Tick::text() const {
    const LossValues mean = losses();
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "loss " << mean.total;
    if (steps_ == 0) return text.str();
    for (const std::string_view name : all_loss_names()) {
        std::string words(name);
        std::ranges::replace(words, '_', ' ');
        if (mean[name] != 0.0) text << ", " << words << ' ' << mean[name];
    }
    return text.str();
}

JsonValue Tick::json(std::int64_t step, const TrainingPosition& position, double epoch,
                     const TickSpeed& speed) const {
    const LossValues mean = losses();
    JsonValue object = JsonValue::object({{"step", step},
                                          {"stage", position.phase.stage},
                                          {"resolution", position.phase.resolution},
                                          {"epoch", epoch},
                                          {"learning_rate", learning_rate_},
                                          {"images_per_second", speed.images_per_second},
                                          {"loss", mean.total}});
    if (speed.exchange_share) object.add("exchange_share", *speed.exchange_share);
    if (speed.hidden_exchange_share)
        object.add("hidden_exchange_share", *speed.hidden_exchange_share);
    if (speed.disk_share > 0.0) object.add("disk_share", speed.disk_share);
    for (const std::string_view name : loss_names(position.phase.stage))
        object.add(std::string(name), mean[name]);
    if (position.phase.stage == 1) return object;
    object.add("fade", position.fade);
    for (const std::string_view name : discriminator_loss_names)
        object.add(std::string(name), mean[name]);
    return object;
}

ValidationScore validation_score(const Model& model, const ReconstructionLoss& reconstruction,
                                 const Dataset& faces, std::int64_t count, std::int64_t resolution,
                                 std::int64_t samples_per_ray) {
    ValidationScore sum;
    std::int64_t scored = 0;
    for (std::int64_t index = 0; index < count; ++index) {
        const FaceBatch batch =
            make_batch(std::vector{faces.load(index)}, model.decoder().ladder().smallest());
        const Tensor known = known_at(batch.known, resolution, resolution);
        if (known_share(known) == 0.0) continue;
        ++scored;
        const Codes codes = face_codes(model, batch);
        const Decoded decoded = model.decoder()(
            codes, batch.cameras, {.samples_per_ray = samples_per_ray, .resolution = resolution});
        const ReconstructionLoss::Target target =
            reconstruction.target(batch.targets, resolution, batch.known);
        sum.reconstruction += reconstruction(decoded.images, target).total.value().item();
        const int side = static_cast<int>(resolution);
        const Tensor mask = clamp(resize_bicubic(batch.mask, side, side), 0.0, 1.0).value();
        const Tensor image =
            masked_image(display_image(where_known(known, decoded.images.back(), -1.0).value(), 0),
                         display_mask(mask, 0));
        // Mean over the known pixels, where alone both differ.
        const Tensor photo =
            masked_image(display_image(target.images.back(), 0), display_mask(mask, 0));
        sum.psnr +=
            peak_signal_to_noise_ratio(image, photo) + 10.0 * std::log10(known_share(known));
    }
    // NaN if none was scored.
    const auto faces_scored = static_cast<double>(scored);
    return {sum.reconstruction / faces_scored, sum.psnr / faces_scored};
}

Tensor sample_sheet(const Model& model, const Dataset& faces, std::int64_t resolution,
                    std::int64_t samples_per_ray, const PhotoOffsets* offsets) {
    std::vector<Tensor> tiles;
    for (std::int64_t index = 0; index < std::min(faces_shown, faces.size()); ++index) {
        const FaceBatch batch =
            make_batch(std::vector{faces.load(index)}, model.decoder().ladder().smallest());
        const Codes codes = face_codes(model, batch, offsets);
        const auto show = [&](const Camera& camera) {
            if (camera_problem(model.config().decoder, camera))
                return tiles.push_back(Tensor::zeros({resolution, resolution, 3}));
            tiles.push_back(
                render_view(model, codes, 0, camera,
                            {.samples_per_ray = samples_per_ray, .resolution = resolution})
                    .image);
        };
        const auto target = std::ranges::find(batch.targets, resolution,
                                              [](const Tensor& images) { return images.shape(1); });
        tiles.push_back(display_image(*target, 0));
        show(face_cameras(batch, offsets).front());
        for (const double yaw_degrees : {-30.0, 0.0, 30.0}) {
            show(turned_camera(model.config().camera, head_middle,
                               radians_from_degrees(yaw_degrees), 0.0, 0.0));
        }
    }
    return tile_images(tiles, 5);
}

}  // namespace stymo
