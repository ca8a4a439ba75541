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

std::string plan_text(Trainer& trainer, const TrainConfig& config, const Dataset& training) {
    const ParameterStore& parameters = trainer.model().parameters();
    const std::int64_t encoder = parameters.element_count("encoder.");
    const std::int64_t decoder = parameters.element_count("decoder.");
    const auto start = std::chrono::steady_clock::now();
    const LossTerms losses = trainer.step();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const auto steps = static_cast<double>(config.stage1.steps);
    std::ostringstream text;
    text << std::fixed << std::setprecision(2);
    text << "parameters    encoder " << encoder << ", decoder " << decoder << '\n'
         << "images        " << training.size() << " for training, " << config.model.decoder.resolution << " pixels a side\n"
         << "stage 1       " << config.stage1.steps << " steps of " << config.stage1.batch << " images ("
         << config.stage1.micro_batch << " at once), " << config.stage1.samples_per_ray << " samples per ray, "
         << steps * static_cast<double>(config.stage1.batch) / static_cast<double>(training.size()) << " epochs\n"
         << "one step      " << seconds << " s, loss " << losses.total << '\n'
         << "all steps     " << duration_text(seconds * steps) << '\n'
         << "peak memory   " << peak_megabytes() << " MiB\n";
    return text.str();
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
