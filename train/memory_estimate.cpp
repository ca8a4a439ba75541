#include "train/memory_estimate.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/machine_limits.h"
#include "nn/models/code_correction.h"
#include "train/gradient_sums.h"
#include "train/loss_terms.h"

namespace stymo {

namespace {

constexpr std::int64_t bytes_per_number = 4;
constexpr double gibibyte = 1024.0 * 1024.0 * 1024.0;
/// Program and libraries.
constexpr std::int64_t program_bytes = 120 << 20;
/// Heap size divided by requested memory: freed blocks do not always fit the next request.
constexpr double heap_factor = 1.15;
/// Safety margin: a step fits into the budget even if the estimate is too low by this factor.
constexpr double estimate_margin = 1.25;
/// Without a budget, share of the machine's memory that micro-batches side by side may use.
constexpr double machine_part = 0.5;

double machine_gibibytes() {
    return static_cast<double>(usable_memory_bytes()) / gibibyte;
}

std::int64_t micro_batches_of(const TrainingPhase& phase) {
    return std::max<std::int64_t>(1, phase.micro_batches());
}

bool has_discriminator(const TrainConfig& config, const TrainingPhase& phase) {
    return phase.stage == 2 && config.loss.adversarial_weight > 0.0;
}

/// Elements that last from step to step: all weights; for trained ones gradients, their sums and
/// both moments; the EMA of all weights.
std::int64_t lasting_numbers(const Model& model, const ReconstructionLoss& loss,
                             const TrainConfig& config, const TrainingPhase& phase,
                             std::int64_t at_once, std::int64_t offset_numbers) {
    const std::int64_t gradients =
        std::max<std::int64_t>(2, GradientTree::most_sets(micro_batches_of(phase), at_once));
    const std::int64_t all = model.parameters().element_count();
    const std::int64_t decoder = model.parameters().element_count("decoder.");
    const double half_life =
        phase.stage == 1 ? config.stage1.average_half_life : config.stage2.average_half_life;
    std::int64_t numbers =
        (half_life > 0.0 ? 2 : 1) * all + (2 + gradients) * (phase.stage == 1 ? all : decoder);
    numbers += (phase.stage == 1 ? 3 + gradients : 1) * offset_numbers;
    if (loss.lpips() != nullptr) numbers += loss.lpips()->element_count();
    // Three more for each weight of the discriminator: the state to which a failed step returns.
    if (has_discriminator(config, phase))
        numbers += (6 + gradients) * Discriminator::element_count(
                                         config.discriminator, model.decoder().ladder().largest());
    return numbers;
}

LayerMemory discriminator_memory(const TrainConfig& config, const TrainingPhase& phase) {
    return Discriminator::memory(config.discriminator, phase.resolution, phase.micro_batch);
}

std::int64_t generator_numbers(const Model& model, const ReconstructionLoss& loss,
                               const TrainConfig& config, const TrainingPhase& phase,
                               const Recomputation& recomputation) {
    const std::int64_t side = model.decoder().ladder().largest();
    const bool reads_others = config.data.other_photo > 0.0 || config.data.turned_photos > 0.0;
    const std::int64_t encoded = reads_others ? 2 : 1;
    // The photos at full size for the encoder and for the losses, with their masks.
    LayerMemory memory{phase.micro_batch * (7 + 3 * encoded) * side * side, 0};
    memory.add(
        model.decoder().memory({.samples_per_ray = phase.samples_per_ray,
                                .resolution = phase.resolution,
                                .mask = config.loss.mask_weight > 0.0 && phase.resolution == side,
                                .gradient_tolerance = config.optimizer.sample_tolerance,
                                .keep_field = !recomputation.field,
                                .recompute_blocks = recomputation.blocks},
                               phase.micro_batch));
    if (phase.stage == 1 && model.has_encoder())
        memory.saved += phase.micro_batch * encoded * model.encoder().backbone().saved();
    memory.add(correction_memory(model));
    memory.add(loss.memory(phase.resolution));
    if (config.loss.compares_identity())
        memory.add({0, phase.micro_batch * IdentityNetwork::saved_per_image});
    const int asides = (config.loss.expression_weight > 0.0 ? 1 : 0) +
                       (config.loss.side_identity_weight > 0.0 ? 1 : 0);
    if (phase.stage == 1 && asides > 0)
        memory.add(
            model.decoder().memory({.samples_per_ray = phase.samples_per_ray,
                                    .resolution = aside_side(model.decoder().ladder(), phase)},
                                   asides * std::max<std::int64_t>(phase.micro_batch / 2, 1)));
    if (has_discriminator(config, phase)) {
        const LayerMemory discriminator = discriminator_memory(config, phase);
        // A frozen layer keeps no input, only what its activation needs.
        memory.add({0, discriminator.saved / 2 + discriminator.transient});
    }
    return memory.saved + memory.transient;
}

}  // namespace

std::int64_t StepMemory::peak() const {
    return persistent + std::max({generator, discriminator, regularizer});
}

StepMemory estimate_step_memory(const Model& model, const ReconstructionLoss& loss,
                                const TrainConfig& config, const TrainingPhase& phase,
                                const StepExecution& execution, std::int64_t offset_numbers) {
    const std::int64_t at_once = execution.at_once(phase);
    const auto heap_bytes = [at_once](std::int64_t numbers) {
        return static_cast<std::int64_t>(heap_factor *
                                         static_cast<double>(bytes_per_number * at_once * numbers));
    };
    StepMemory memory;
    memory.persistent =
        program_bytes +
        bytes_per_number * lasting_numbers(model, loss, config, phase, at_once, offset_numbers);
    memory.generator =
        heap_bytes(generator_numbers(model, loss, config, phase, execution.recomputation));
    if (has_discriminator(config, phase)) {
        // The targets and masks of a step's photos serve all its updates.
        const std::int64_t side = model.decoder().ladder().largest();
        memory.persistent += bytes_per_number * phase.batch *
                             (4 * phase.resolution * phase.resolution + side * side);
        const LayerMemory discriminator = discriminator_memory(config, phase);
        memory.discriminator = heap_bytes(discriminator.saved + discriminator.transient);
        memory.regularizer = heap_bytes(9 * discriminator.saved / 4 + discriminator.transient);
    }
    return memory;
}

StepExecution choose_execution(const Model& model, const ReconstructionLoss& loss,
                               const TrainConfig& config, const TrainingPhase& phase,
                               std::int64_t offset_numbers) {
    const double budget = config.memory.budget_gibibytes;
    const StepExecution fastest{.recomputation = {}, .side_by_side = true};
    const auto gibibytes_of = [&](const StepExecution& execution) {
        const StepMemory memory =
            estimate_step_memory(model, loss, config, phase, execution, offset_numbers);
        return estimate_margin * static_cast<double>(memory.peak()) / gibibyte;
    };
    if (budget == 0.0)
        return gibibytes_of(fastest) <= machine_part * machine_gibibytes() ? fastest
                                                                           : StepExecution{};
    double needed = 0.0;
    for (const StepExecution& execution :
         {fastest, StepExecution{}, StepExecution{.recomputation = {.blocks = true}},
          StepExecution{.recomputation = {.blocks = true, .field = true}}}) {
        needed = gibibytes_of(execution);
        if (needed <= budget) return execution;
    }
    fail<ConfigError>("memory.budget_gibibytes = ", budget, " is too little for stage ",
                      phase.stage, " at ", phase.resolution, " pixels with ", phase.micro_batch,
                      " images at once; it needs ", std::ceil(needed * 10.0) / 10.0,
                      " or a smaller micro_batch");
}

}  // namespace stymo
