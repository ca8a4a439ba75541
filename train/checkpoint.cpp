#include "train/checkpoint.h"

#include <algorithm>
#include <charconv>
#include <functional>
#include <optional>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "train/checkpoint_checksums.h"
#include "train/checkpoint_folder.h"

namespace stymo {

namespace {

constexpr const char* model_name = "model.safetensors";
constexpr const char* state_name = "state.safetensors";
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

struct CheckpointFiles {
    TensorFile state;
    TensorFile weights;
};

/// Throws FileError if a file is missing or damaged or belongs to another step.
CheckpointFiles read_files(const std::filesystem::path& folder) {
    verify_checksums(folder);
    CheckpointFiles files{read_tensor_file(folder / state_name),
                          read_tensor_file(folder / model_name)};
    const auto step = files.state.metadata.find("step");
    const std::optional<std::int64_t> number = checkpoint_step(folder);
    if (number && step != files.state.metadata.end() && step->second != std::to_string(*number))
        fail<FileError>((folder / state_name).string(), ": is of step ", step->second,
                        ", not of step ", *number);
    return files;
}

/// Which checkpoint to resume from instead of a damaged one.
std::string advice(const std::filesystem::path& damaged) {
    const std::optional<std::int64_t> number = checkpoint_step(damaged);
    std::error_code error;
    std::vector<std::pair<std::int64_t, std::filesystem::path>> older;
    for (const auto& entry : std::filesystem::directory_iterator(damaged.parent_path(), error)) {
        const std::optional<std::int64_t> other = checkpoint_step(entry.path());
        if (number && other && *other < *number) older.emplace_back(*other, entry.path());
    }
    std::ranges::sort(older, std::ranges::greater());
    for (const auto& [step, folder] : older) {
        try {
            static_cast<void>(read_files(folder));
            return "; --resume " + folder.string() + " works";
        } catch (const FileError&) {
            continue;
        }
    }
    return "";
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
        model.save(unfinished / model_name);
        write_tensor_file(unfinished / state_name, file);
        write_checksums(unfinished);
    });
}

Checkpoint read_checkpoint(const std::filesystem::path& folder, Model& model) {
    repair_checkpoint_folder(folder);
    CheckpointFiles files;
    try {
        files = read_files(folder);
    } catch (const FileError& error) {
        fail<FileError>(error.what(), advice(folder));
    }
    const std::string source = (folder / state_name).string();
    Checkpoint checkpoint{{}, std::move(files.state)};
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
    // Last, so that an unreadable state leaves the model unchanged.
    model.parameters().load(files.weights, (folder / model_name).string());
    return checkpoint;
}

}  // namespace stymo
