#include "train/checkpoint.h"

#include <charconv>

#include "core/error.h"
#include "train/checkpoint_folder.h"

namespace stymo {

namespace {

constexpr const char* epoch_losses_name = "state.epoch_losses";

template <class T>
std::string exact_text(T value) {
    char text[64];
    const auto end = std::to_chars(std::begin(text), std::end(text), value);
    return {text, end.ptr};
}

template <class T>
void read_exact(const TensorFile& file, const std::string& source, const char* key, T& value) {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end())
        fail<FileError>(source, ": not a training state (\"", key, "\" is missing)");
    const std::string& text = found->second;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (end.ec != std::errc{} || end.ptr != text.data() + text.size())
        fail<FileError>(source, ": \"", key, "\" is \"", text, "\", not a number");
}

/// Calls visit(key, field) for every number of the state.
template <class State, class Visit>
void for_each_number(State& state, Visit visit) {
    visit("seed", state.seed);
    visit("step", state.step);
    visit("epoch_loss_sum", state.epoch_loss_sum);
    visit("epoch_loss_count", state.epoch_loss_count);
    visit("failures", state.failures);
    visit("best_validation", state.best_validation);
    visit("best_resolution", state.best_resolution);
}

}  // namespace

void write_checkpoint(const std::filesystem::path& folder, const Model& model,
                      const Checkpoint& checkpoint) {
    TensorFile file = checkpoint.tensors;
    for_each_number(checkpoint.state,
                    [&](const char* key, auto value) { file.metadata[key] = exact_text(value); });
    file.metadata["mask_loss"] = checkpoint.state.mask_loss ? "1" : "0";
    const auto epochs = static_cast<std::int64_t>(checkpoint.state.epoch_losses.size());
    file.tensors[epoch_losses_name] =
        Tensor::from({epochs}, std::span<const double>(checkpoint.state.epoch_losses));
    write_checkpoint_folder(folder, [&](const std::filesystem::path& unfinished) {
        model.save(unfinished / "model.safetensors");
        write_tensor_file(unfinished / "state.safetensors", file);
    });
}

Checkpoint read_checkpoint(const std::filesystem::path& folder, Model& model) {
    repair_checkpoint_folder(folder);
    const std::string model_file = (folder / "model.safetensors").string();
    const std::string source = (folder / "state.safetensors").string();
    Checkpoint checkpoint{{}, read_tensor_file(source)};
    TensorFile& file = checkpoint.tensors;
    for_each_number(checkpoint.state,
                    [&](const char* key, auto& value) { read_exact(file, source, key, value); });
    int mask_loss = 0;
    read_exact(file, source, "mask_loss", mask_loss);
    checkpoint.state.mask_loss = mask_loss != 0;
    const auto losses = file.tensors.find(epoch_losses_name);
    if (losses == file.tensors.end())
        fail<FileError>(source, ": not a training state (\"", epoch_losses_name, "\" is missing)");
    checkpoint.state.epoch_losses = losses->second.to_vector();
    // Last, so that a state that cannot be read leaves the model as it was.
    model.parameters().load(read_tensor_file(model_file), model_file);
    return checkpoint;
}

}  // namespace stymo
