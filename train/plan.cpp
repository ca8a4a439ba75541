#include "train/plan.h"

#include <sys/resource.h>

#include <chrono>
#include <iomanip>
#include <sstream>

#include "core/progress.h"

namespace stymo {

namespace {

double peak_megabytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

}  // namespace

TrainingPlan measure_plan(Trainer& trainer, const TrainConfig& config, const Dataset& training) {
    const ParameterStore& parameters = trainer.model().parameters();
    const auto start = std::chrono::steady_clock::now();
    const LossTerms losses = trainer.step();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const double images_in_all = static_cast<double>(config.stage1.steps) * static_cast<double>(config.stage1.batch);
    return {parameters.element_count("encoder."),
            parameters.element_count("decoder."),
            training.size(),
            config.model.decoder.resolution,
            config.stage1,
            images_in_all / static_cast<double>(training.size()),
            seconds,
            losses.total,
            peak_megabytes()};
}

std::string plan_text(const TrainingPlan& plan) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(2);
    text << "parameters    encoder " << plan.encoder_parameters << ", decoder " << plan.decoder_parameters << '\n'
         << "images        " << plan.images << " for training, " << plan.side << " pixels a side\n"
         << "stage 1       " << plan.stage.steps << " steps of " << plan.stage.batch << " images (" << plan.stage.micro_batch
         << " at once), " << plan.stage.samples_per_ray << " samples per ray, " << plan.epochs << " epochs\n"
         << "one step      " << plan.step_seconds << " s, loss " << plan.step_loss << '\n'
         << "all steps     " << duration_text(plan.step_seconds * static_cast<double>(plan.stage.steps)) << '\n'
         << "peak memory   " << plan.peak_megabytes << " MiB\n";
    return text.str();
}

JsonValue to_json(const TrainingPlan& plan) {
    return JsonValue::object({{"encoder_parameters", plan.encoder_parameters},
                              {"decoder_parameters", plan.decoder_parameters},
                              {"images", plan.images},
                              {"side", plan.side},
                              {"steps", plan.stage.steps},
                              {"batch", plan.stage.batch},
                              {"micro_batch", plan.stage.micro_batch},
                              {"samples_per_ray", plan.stage.samples_per_ray},
                              {"epochs", plan.epochs},
                              {"step_seconds", plan.step_seconds},
                              {"step_loss", plan.step_loss},
                              {"peak_megabytes", plan.peak_megabytes}});
}

std::string outcome_text(const TrainingOutcome& outcome, const RunFolder& folder) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "steps " << outcome.steps
         << (outcome.finished ? "" : " (stopped early; --resume latest goes on)") << ", loss " << outcome.last_tick.total
         << ", reconstruction " << outcome.last_tick.reconstruction << std::setprecision(1) << ", " << outcome.images_per_second
         << " images/s, " << duration_text(outcome.seconds) << ", " << folder.model_file().string() << '\n';
    return text.str();
}

JsonValue to_json(const TrainingOutcome& outcome, const RunFolder& folder) {
    return JsonValue::object({{"steps", outcome.steps},
                              {"finished", outcome.finished},
                              {"seconds", outcome.seconds},
                              {"images_per_second", outcome.images_per_second},
                              {"loss", outcome.last_tick.total},
                              {"reconstruction", outcome.last_tick.reconstruction},
                              {"model", folder.model_file().string()}});
}

}  // namespace stymo
