#include "apps/common/model_options.h"

#include "apps/common/shipped_file.h"
#include "nn/models/weight_changes.h"

namespace stymo {

void declare_model(Command& command, ModelOptions& options) {
    command.option("--model", options.file,
                   "model.safetensors of a training run (default: the model that comes with "
                   "stymo)");
}

void declare_tuned(Command& command, ModelOptions& options) {
    command.option("--tuned", options.tuned,
                   "tuned.safetensors of stymo-fit --tune: the weights of one face, for the same "
                   "model");
}

std::filesystem::path model_file(const ModelOptions& options) {
    if (!options.file.empty()) return options.file;
    const std::filesystem::path file = shipped_file("models/faces-256/model.safetensors");
    if (!file.empty()) return file;
    fail<UsageError>("--model is required: no model lies beside this program");
}

Model load_model(const ModelOptions& options, ModelParts parts) {
    Model model = Model::load(model_file(options), parts);
    if (options.tuned.empty()) return model;
    const WeightChanges changes = WeightChanges::load(options.tuned);
    try {
        changes.apply(model);
    } catch (const ValueError& error) {
        fail<FileError>(options.tuned.string(), ": ", error.what());
    }
    return model;
}

}  // namespace stymo
