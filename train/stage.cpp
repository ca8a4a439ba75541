#include "train/stage.h"

#include <cmath>
#include <sstream>

#include "core/ops/elementwise.h"
#include "core/parallel.h"
#include "render/rays.h"
#include "train/gradient_sums.h"

namespace stymo {

namespace {

std::vector<std::int64_t> bytes_of(const std::vector<Parameter>& parameters) {
    std::vector<std::int64_t> bytes;
    for (const Parameter& parameter : parameters) {
        const Tensor& value = parameter.variable().value();
        bytes.push_back(value.size() * static_cast<std::int64_t>(size_in_bytes(value.dtype())));
    }
    return bytes;
}

/// Means over the micro-batches of all ranks; each micro-batch has the weight `part`.
LossValues mean_losses(Ranks& ranks, const std::vector<LossValues>& own, double part) {
    LossValues mean;
    if (ranks.size() == 1) {
        for (const LossValues& one : own) mean.accumulate(one, part);
        return mean;
    }
    std::string text;
    for (const LossValues& one : own) text += one.text() + '\n';
    for (const std::string& all : gather(ranks, text)) {
        std::istringstream lines(all);
        for (std::string line; std::getline(lines, line);)
            mean.accumulate(LossValues::parse(line), part);
    }
    return mean;
}

}  // namespace

void for_each_micro_batch(std::int64_t count, bool side_by_side,
                          const std::function<void(std::int64_t)>& body) {
    if (side_by_side) return parallel_tasks(count, body);
    for (std::int64_t i = 0; i < count; ++i) body(i);
}

MicroBatch load_micro_batch(const TrainingParts& parts, const TrainingPosition& position,
                            std::int64_t index) {
    const TrainingPhase& phase = position.phase;
    const std::int64_t own = phase.micro_batches() / parts.ranks.size();
    const std::int64_t first = (parts.ranks.rank() * own + index) * phase.micro_batch;
    return {parts.images.batch(position.first_image + first, phase.micro_batch, phase.resolution),
            first};
}

LossAndGradients mean_over_micro_batches(const TrainingParts& parts,
                                         const TrainingPosition& position,
                                         const std::vector<Parameter>& parameters,
                                         std::span<const MicroBatch> loaded,
                                         const MicroBatchGradients& gradients_of) {
    const TrainingPhase& phase = position.phase;
    const std::int64_t all = phase.micro_batches(), own = all / parts.ranks.size();
    GradientExchange exchange(parts.ranks, bytes_of(parameters));
    GradientTree tree(own, [&](std::size_t i, Tensor sum) { exchange.add(i, std::move(sum)); });
    std::vector<LossValues> losses(static_cast<std::size_t>(own));
    for_each_micro_batch(own, phase.execution.side_by_side, [&](std::int64_t k) {
        const auto index = static_cast<std::size_t>(k);
        losses[index] = gradients_of(
            loaded.empty() ? load_micro_batch(parts, position, k) : loaded[index],
            [&](std::size_t i, const Variable& gradient) { tree.add(k, i, gradient.value()); });
    });
    const double part = 1.0 / static_cast<double>(all);
    LossAndGradients mean;
    for (const Tensor& sum : exchange.take_sums()) mean.gradients.push_back(Variable(sum) * part);
    mean.losses = mean_losses(parts.ranks, losses, part);
    return mean;
}

std::optional<std::string> non_finite(const LossAndGradients& update,
                                      const std::vector<Parameter>& parameters) {
    if (const std::optional<std::string> name = first_non_finite(parameters, update.gradients))
        return name;
    return std::isfinite(update.losses.total) ? std::nullopt
                                              : std::optional<std::string>("the loss");
}

std::vector<Parameter> unfreeze_only(ParameterStore& parameters,
                                     const std::vector<std::string>& prefixes) {
    parameters.set_trainable("", false);
    for (const std::string& prefix : prefixes) parameters.set_trainable(prefix, true);
    return parameters.trainable();
}

std::vector<std::string> trained_decoder_prefixes(const Model& model,
                                                  const TrainingPosition& position) {
    std::vector<std::string> prefixes{"decoder.mapping.", "decoder.field."};
    const ResolutionLadder ladder = model.decoder().ladder().up_to(position.phase.resolution);
    for (const std::int64_t side : ladder.sides())
        prefixes.push_back("decoder.block" + std::to_string(side) + ".");
    if (position.mask_loss) prefixes.emplace_back("decoder.mask.");
    return prefixes;
}

void update_generator(const TrainingParts& parts, const TrainingPosition& position,
                      const Adversary& adversary, const std::vector<Parameter>& parameters,
                      std::span<const MicroBatch> loaded, HybridOptimizer& optimizer,
                      const OptimizerRates& rates, StepReport& report) {
    const LossAndGradients mean = mean_over_micro_batches(
        parts, position, parameters, loaded,
        [&](const MicroBatch& batch, const GradientSink& sink) {
            Rng jitter = step_jitter(parts, position, "jitter", batch.first_image);
            const std::vector<ImageAugmentation> augmentations =
                step_augmentations(parts, position, "augmentation", batch.first_image,
                                   std::ssize(batch.faces.cameras), adversary.augmentation);
            const GeneratorInputs inputs{parts.model,
                                         parts.reconstruction,
                                         parts.config,
                                         parts.offsets,
                                         adversary.discriminator,
                                         augmentations,
                                         batch.codes ? &*batch.codes : nullptr,
                                         parts.identity};
            return generator_gradients(inputs, position, batch.faces, parameters, jitter, sink)
                .losses;
        });
    report.losses.accumulate(mean.losses, 1.0);
    report.learning_rate = rates.learning_rate;
    report.non_finite = non_finite(mean, parameters);
    if (report.non_finite) return;
    optimizer.step(parameters, mean.gradients, rates);
}

Rng step_jitter(const TrainingParts& parts, const TrainingPosition& position,
                std::string_view purpose, std::int64_t image) {
    const TrainingPhase& phase = position.phase;
    const std::int64_t rays = parts.model.decoder().work(phase.resolution).rays;
    return parts.rng.split(purpose)
        .split(static_cast<std::uint64_t>(phase.first_step + position.step))
        .skipped(image * rays * jitter_numbers(phase.samples_per_ray));
}

std::vector<ImageAugmentation> step_augmentations(const TrainingParts& parts,
                                                  const TrainingPosition& position,
                                                  std::string_view purpose, std::int64_t image,
                                                  std::int64_t count, double probability) {
    std::vector<ImageAugmentation> augmentations;
    const Rng rng = parts.rng.split(purpose).split(
        static_cast<std::uint64_t>(position.phase.first_step + position.step));
    for (std::int64_t i = 0; probability > 0.0 && i < count; ++i)
        augmentations.push_back(
            drawn_augmentation(rng.split(static_cast<std::uint64_t>(image + i)), probability));
    return augmentations;
}

}  // namespace stymo
