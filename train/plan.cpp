#include "train/plan.h"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <cmath>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "core/clock.h"
#include "core/machine_limits.h"
#include "core/progress.h"

namespace stymo {

namespace {

constexpr double mebibyte = 1048576.0;

/// Makes the present resident memory the largest one so far. Returns whether the system did so.
bool reset_peak_memory() {
#ifdef __GLIBC__
    malloc_trim(0);  // what earlier phases have left is not part of the next one
#endif
    std::ofstream("/proc/self/clear_refs") << "5";
    constexpr double meanwhile = 8.0 * mebibyte;
    const double resident = process_memory("VmRSS:");
    return resident > 0.0 && process_memory("VmHWM:") <= resident + meanwhile;
}

/// Does one more step and returns its time.
double measured_step(Trainer& trainer, StepReport& report) {
    const double start = seconds_now();
    report = trainer.step();
    return seconds_now() - start;
}

void measure(PhasePlan& plan, Trainer& trainer, const TrainConfig& config) {
    const bool knows_peak = reset_peak_memory();
    trainer.skip_to(plan.phase.first_step);
    StepReport report;
    plan.step_seconds = measured_step(trainer, report);
    plan.step_loss = report.losses.total;
    // A phase begins with one of its dear steps.
    const std::int64_t interval =
        plan.phase.stage == 1 ? config.stage1.pose_interval : config.stage2.r1_interval;
    const bool poses = plan.phase.stage == 1 && interval > 1;
    if (report.regularized || poses) {
        StepReport plain;
        const double part = 1.0 / static_cast<double>(interval);
        plan.step_seconds = part * plan.step_seconds + (1.0 - part) * measured_step(trainer, plain);
    }
    if (knows_peak) plan.peak_megabytes = process_memory("VmHWM:") / mebibyte;
    plan.measured = true;
}

std::int64_t discriminator_parameters(const TrainConfig& config) {
    if (config.stage2.resolutions.empty() || config.loss.adversarial_weight == 0.0) return 0;
    ParameterStore store;
    Rng rng(0);
    const Discriminator discriminator(config.discriminator, config.model.decoder.resolution, store,
                                      "discriminator", rng);
    return store.element_count();
}

std::string network_of(const Lpips* lpips) {
    return lpips == nullptr ? "" : lpips->label();
}

std::string execution_text(const TrainingPhase& phase) {
    const StepExecution& execution = phase.execution;
    if (execution.recomputation.field) return ", render blocks and field computed twice";
    if (execution.recomputation.blocks) return ", render blocks computed twice";
    const std::int64_t at_once = execution.at_once(phase);
    return at_once > 1 ? ", " + std::to_string(at_once) + " micro-batches side by side" : "";
}

}  // namespace

TrainingPlan measure_plan(Trainer& trainer, const TrainConfig& config, const Dataset& training,
                          MeasuredPhases measured) {
    TrainingPlan plan{.encoder_parameters = trainer.model().parameters().element_count("encoder."),
                      .decoder_parameters = trainer.model().parameters().element_count("decoder."),
                      .discriminator_parameters = discriminator_parameters(config),
                      .lpips_network = network_of(trainer.reconstruction().lpips()),
                      .images = training.size(),
                      .side = config.model.decoder.resolution};
    const std::vector<TrainingPhase>& phases = trainer.schedule().phases();
    for (const TrainingPhase& phase : phases) {
        const auto images = static_cast<double>(phase.steps * phase.batch);
        PhasePlan& part = plan.phases.emplace_back(
            PhasePlan{.phase = phase, .epochs = images / static_cast<double>(plan.images)});
        part.estimated_megabytes =
            static_cast<double>(estimate_step_memory(trainer.model(), trainer.reconstruction(),
                                                     config, phase, phase.execution,
                                                     trainer.offset_numbers())
                                    .peak()) /
            mebibyte;
        const bool at_an_end = &phase == &phases.front() || &phase == &phases.back();
        if (measured == MeasuredPhases::all || (measured == MeasuredPhases::ends && at_an_end))
            measure(part, trainer, config);
    }
    return plan;
}

std::string plan_text(const TrainingPlan& plan) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(2);
    text << "parameters    encoder " << plan.encoder_parameters << ", decoder "
         << plan.decoder_parameters;
    if (plan.discriminator_parameters > 0)
        text << ", discriminator " << plan.discriminator_parameters;
    if (!plan.lpips_network.empty()) text << "\nLPIPS         " << plan.lpips_network;
    text << "\nimages        " << plan.images << " for training, " << plan.side
         << " pixels a side\n";
    for (const PhasePlan& part : plan.phases) {
        const TrainingPhase& phase = part.phase;
        text << "stage " << phase.stage << ", " << std::setw(4) << phase.resolution << ' '
             << phase.steps << " steps of " << phase.batch << " images (" << phase.micro_batch
             << " at once), " << phase.samples_per_ray << " samples per ray, " << part.epochs
             << " epochs\n  memory      about " << std::llround(part.estimated_megabytes) << " MiB"
             << execution_text(phase) << '\n';
        if (!part.measured) continue;
        text << "  one step    " << part.step_seconds << " s, loss " << part.step_loss
             << ", peak memory ";
        if (part.peak_megabytes)
            text << *part.peak_megabytes << " MiB";
        else
            text << "not measured";
        text << "\n  all steps   "
             << duration_text(part.step_seconds * static_cast<double>(phase.steps)) << '\n';
    }
    return text.str();
}

JsonValue to_json(const TrainingPlan& plan) {
    std::vector<JsonValue> phases;
    for (const PhasePlan& part : plan.phases) {
        JsonValue phase =
            JsonValue::object({{"stage", part.phase.stage},
                               {"resolution", part.phase.resolution},
                               {"first_step", part.phase.first_step},
                               {"steps", part.phase.steps},
                               {"batch", part.phase.batch},
                               {"micro_batch", part.phase.micro_batch},
                               {"samples_per_ray", part.phase.samples_per_ray},
                               {"epochs", part.epochs},
                               {"side_by_side", part.phase.execution.at_once(part.phase)},
                               {"recomputed_blocks", part.phase.execution.recomputation.blocks},
                               {"recomputed_field", part.phase.execution.recomputation.field},
                               {"estimated_megabytes", part.estimated_megabytes}});
        if (part.measured) {
            phase.add("step_seconds", part.step_seconds);
            phase.add("step_loss", part.step_loss);
            if (part.peak_megabytes) phase.add("peak_megabytes", *part.peak_megabytes);
        }
        phases.push_back(phase);
    }
    JsonValue object =
        JsonValue::object({{"encoder_parameters", plan.encoder_parameters},
                           {"decoder_parameters", plan.decoder_parameters},
                           {"discriminator_parameters", plan.discriminator_parameters},
                           {"images", plan.images},
                           {"side", plan.side},
                           {"phases", phases}});
    if (!plan.lpips_network.empty()) object.add("lpips_network", plan.lpips_network);
    return object;
}

std::string outcome_text(const TrainingOutcome& outcome, const RunFolder& folder) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "steps " << outcome.steps
         << (outcome.finished ? "" : " (stopped early; --resume latest goes on)");
    if (const std::optional<LossValues>& losses = outcome.last_tick)
        text << ", loss " << losses->total << ", reconstruction " << (*losses)["reconstruction"];
    text << std::setprecision(1) << ", " << outcome.images_per_second << " images/s, "
         << duration_text(outcome.seconds) << ", " << folder.model_file().string() << '\n';
    return text.str();
}

JsonValue to_json(const TrainingOutcome& outcome, const RunFolder& folder) {
    const std::optional<LossValues>& losses = outcome.last_tick;
    return JsonValue::object(
        {{"steps", outcome.steps},
         {"finished", outcome.finished},
         {"seconds", outcome.seconds},
         {"images_per_second", outcome.images_per_second},
         {"loss", losses ? JsonValue(losses->total) : JsonValue()},
         {"reconstruction", losses ? JsonValue((*losses)["reconstruction"]) : JsonValue()},
         {"model", folder.model_file().string()}});
}

}  // namespace stymo
