#include "train/landmarks/landmark_training.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "nn/optim/adam.h"
#include "nn/optim/ema.h"
#include "train/landmarks/photo_variation.h"

namespace stymo {
namespace {

constexpr std::int64_t network_side = LandmarkNetwork::input_side;

struct Batch {
    Tensor images;   ///< (B, side, side, 3)
    Tensor points;   ///< (B, 68, 2)
    Tensor weights;  ///< (B, 68, 1), with mean 1
};

/// The examples that a run learns from.
class Examples {
public:
    Examples(const HeadPictures& pictures, const std::vector<Tensor>& backgrounds,
             const std::vector<LandmarkExample>& photos, const LandmarkTrainingSettings& settings,
             const Rng& rng)
        : pictures_(pictures),
          backgrounds_(backgrounds),
          photos_(photos),
          settings_(settings),
          rng_(rng),
          heads_(static_cast<std::size_t>(settings.heads)) {
        parallel_for(settings.heads, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t k = begin; k < end; ++k)
                if (!interrupted()) draw_head(k);
        });
        drawn_ = settings.heads;
    }

    /// Replaces the oldest heads and takes a batch.
    [[nodiscard]] Batch next(std::int64_t step) {
        parallel_for(settings_.new_heads, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t k = begin; k < end; ++k) draw_head(drawn_ + k);
        });
        drawn_ += settings_.new_heads;
        Batch batch{Tensor({settings_.batch, network_side, network_side, 3}),
                    Tensor({settings_.batch, 68, 2}), Tensor({settings_.batch, 68, 1})};
        const Rng draws = rng_.split("batch").split(static_cast<std::uint64_t>(step));
        const auto images = batch.images.mutable_values<float>();
        const auto points = batch.points.mutable_values<float>();
        const auto weights = batch.weights.mutable_values<float>();
        parallel_for(settings_.batch, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t row = begin; row < end; ++row) {
                const auto at = static_cast<std::size_t>(row);
                Rng draw = draws.split(static_cast<std::uint64_t>(row));
                const LandmarkExample& example = choose(draw);
                const LandmarkTarget target =
                    varied(example, backgrounds_, network_side, draw.split("variation"));
                std::ranges::copy(target.image.values<float>(),
                                  images.begin() + row * network_side * network_side * 3);
                for (std::size_t k = 0; k < 68; ++k) {
                    points[2 * (68 * at + k)] = static_cast<float>(target.points[k].x());
                    points[2 * (68 * at + k) + 1] = static_cast<float>(target.points[k].y());
                    weights[68 * at + k] = example.weights[k];
                }
            }
        });
        return batch;
    }

private:
    void draw_head(std::int64_t number) {
        heads_[static_cast<std::size_t>(number % settings_.heads)] =
            pictures_.draw(rng_.split("heads").split(static_cast<std::uint64_t>(number)));
    }
    [[nodiscard]] const LandmarkExample& choose(Rng& rng) const {
        const bool photo = !photos_.empty() && rng.uniform() < settings_.photo_share;
        const std::vector<LandmarkExample>& from = photo ? photos_ : heads_;
        return from[static_cast<std::size_t>(rng.below(static_cast<std::int64_t>(from.size())))];
    }

    const HeadPictures& pictures_;
    const std::vector<Tensor>& backgrounds_;
    const std::vector<LandmarkExample>& photos_;
    const LandmarkTrainingSettings& settings_;
    Rng rng_;
    std::vector<LandmarkExample> heads_;
    std::int64_t drawn_ = 0;
};

/// The weighted mean of the distances between found and known points.
[[nodiscard]] Variable mean_distance(const Variable& found, const Batch& batch) {
    const Variable offset = reshape(found, batch.points.shape()) - Variable(batch.points);
    const Variable distance = sqrt(sum(square(offset), {2}) + 1e-6);
    return mean(distance * Variable(batch.weights));
}

}  // namespace

void train_landmarks(LandmarkModel& model, const HeadPictures& pictures,
                     const std::vector<Tensor>& backgrounds,
                     const std::vector<LandmarkExample>& photos,
                     const LandmarkTrainingSettings& settings, const Rng& rng,
                     const std::function<void(std::int64_t, double)>& progress) {
    constexpr double averaging = 0.998;
    const double warm_up_steps = std::min(200.0, 0.05 * static_cast<double>(settings.steps));
    model.store->set_trainable("", true);
    Examples examples(pictures, backgrounds, photos, settings, rng);
    const std::vector<Parameter> parameters = model.store->trainable();
    Adam adam;
    Ema average(parameters);
    for (std::int64_t step = 0; step < settings.steps; ++step) {
        if (interrupted()) fail<Error>("interrupted after ", step, " steps; nothing was written");
        const Batch batch = examples.next(step);
        const Variable loss = mean_distance(model.network(batch.images), batch);
        const double value = loss.value().to_vector().front();
        if (!std::isfinite(value))
            fail<NumericError>("step ", step, ": the loss is not finite; lower the learning rate");
        const double done = static_cast<double>(step) / static_cast<double>(settings.steps);
        const double rate =
            settings.learning_rate * 0.5 * (1.0 + std::cos(std::numbers::pi * done)) *
            std::min(1.0, (static_cast<double>(step) + 1.0) / std::max(1.0, warm_up_steps));
        const std::vector<Variable> variables = variables_of(parameters);
        adam.step(parameters, grad(loss, variables), rate);
        average.update(std::min(
            averaging, (1.0 + static_cast<double>(step)) / (10.0 + static_cast<double>(step))));
        if (progress) progress(step + 1, value);
    }
    average.swap();
    model.store->set_trainable("", false);
}

}  // namespace stymo
