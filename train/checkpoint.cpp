#include "train/checkpoint.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/exact_text.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "train/state_number.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

constexpr const char* list_name = "checksums.txt";

/// Checksum and size of a file in the format of checksums.txt.
std::string seal_of(const fs::path& file) {
    std::uint32_t checksum = 0;
    std::uint64_t size = 0;
    read_parts(file, [&](std::string_view part) {
        checksum = crc32c(part, checksum);
        size += part.size();
    });
    return hexadecimal(checksum, 8) + ' ' + exact_text(size);
}

/// Checksums and sizes of the files, by name.
std::map<std::string, std::string> seals_of(const fs::path& folder) {
    std::map<std::string, std::string> seals;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        if (entry.is_regular_file() && name != list_name) seals[name] = seal_of(entry.path());
    }
    return seals;
}

std::map<std::string, std::string> read_list(const fs::path& list) {
    std::map<std::string, std::string> seals;
    const std::string text = read_file(list);
    if (!text.ends_with('\n')) fail<FileError>(list.string(), ": is damaged");
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        const std::size_t space = line.rfind(' ');
        if (space == std::string::npos) fail<FileError>(list.string(), ": is damaged");
        seals[line.substr(space + 1)] = line.substr(0, space);
    }
    return seals;
}

/// Writes checksums.txt.
void write_checksums(const fs::path& folder) {
    std::string lines;
    for (const auto& [name, seal] : seals_of(folder)) lines += seal + ' ' + name + '\n';
    write_file(folder / list_name, lines);
}

constexpr std::string_view unfinished_suffix = ".unfinished";
constexpr std::string_view replaced_suffix = ".replaced";

fs::path with_suffix(fs::path folder, std::string_view suffix) {
    folder += suffix;
    return folder;
}

void rename_or_fail(const fs::path& from, const fs::path& to, const fs::path& folder) {
    std::error_code error;
    fs::rename(from, to, error);
    if (error) fail<FileError>(folder.string(), ": cannot be written (", error.message(), ")");
}

void remove_or_fail(const fs::path& folder) {
    std::error_code error;
    fs::remove_all(folder, error);
    if (error) fail<FileError>(folder.string(), ": cannot be removed (", error.message(), ")");
}

constexpr const char* model_name = "model.safetensors";
constexpr const char* state_name = "state.safetensors";
constexpr const char* epoch_losses_name = "state.epoch_losses";

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
CheckpointFiles read_files(const fs::path& folder) {
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
std::string advice(const fs::path& damaged) {
    const std::optional<std::int64_t> number = checkpoint_step(damaged);
    std::error_code error;
    std::vector<std::pair<std::int64_t, fs::path>> older;
    for (const auto& entry : fs::directory_iterator(damaged.parent_path(), error)) {
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

void verify_checksums(const fs::path& folder) {
    const fs::path list = folder / list_name;
    if (!fs::exists(list)) return;
    const std::map<std::string, std::string> expected = read_list(list);
    const std::map<std::string, std::string> found = seals_of(folder);
    for (const auto& [name, seal] : expected) {
        const auto file = found.find(name);
        if (file == found.end()) fail<FileError>((folder / name).string(), ": is missing");
        if (file->second != seal)
            fail<FileError>((folder / name).string(), ": is damaged (checksum and size are ",
                            file->second, ", ", list_name, " says ", seal, ")");
    }
    for (const auto& [name, seal] : found)
        if (!expected.contains(name))
            fail<FileError>(list.string(), ": is damaged (", name, " is missing in it)");
}

std::optional<std::int64_t> checkpoint_step(const fs::path& folder) {
    const std::string name = folder.filename().string();
    std::int64_t step = 0;
    const auto end = std::from_chars(name.data(), name.data() + name.size(), step);
    if (end.ec != std::errc{} || end.ptr != name.data() + name.size()) return std::nullopt;
    return step;
}

void write_checkpoint_folder(const fs::path& folder,
                             const std::function<void(const fs::path&)>& write) {
    repair_checkpoint_folder(folder);
    const fs::path source = with_suffix(folder, unfinished_suffix);
    remove_or_fail(source);
    require_writable_folder(source);
    write(source);
    flush_to_disk(source);
    const fs::path older = with_suffix(folder, replaced_suffix);
    if (fs::exists(folder)) rename_or_fail(folder, older, folder);
    try {
        rename_or_fail(source, folder, folder);
    } catch (const FileError&) {
        repair_checkpoint_folder(folder);
        throw;
    }
    flush_names(fs::absolute(folder).parent_path());
    remove_or_fail(older);
}

void remove_checkpoint_folder(const fs::path& folder) {
    const fs::path leaving = with_suffix(folder, unfinished_suffix);
    remove_or_fail(leaving);
    rename_or_fail(folder, leaving, folder);
    flush_names(fs::absolute(folder).parent_path());
    remove_or_fail(leaving);
}

void repair_checkpoint_folder(const fs::path& folder) {
    const fs::path older = with_suffix(folder, replaced_suffix);
    if (!fs::exists(older)) return;
    if (fs::exists(folder)) {
        remove_or_fail(older);
    } else {
        rename_or_fail(older, folder, folder);
    }
}

void repair_checkpoint_folders(const fs::path& folder) {
    // Listed before any change, because a directory iterator may or may not show entries that are
    // renamed meanwhile.
    const std::vector<fs::directory_entry> entries{fs::directory_iterator(folder),
                                                   fs::directory_iterator()};
    for (const fs::directory_entry& entry : entries) {
        fs::path path = entry.path();
        if (path.extension() == unfinished_suffix) remove_or_fail(path);
        if (path.extension() == replaced_suffix) repair_checkpoint_folder(path.replace_extension());
    }
}

void write_checkpoint(const fs::path& folder, const Model& model, const Checkpoint& checkpoint) {
    TensorFile file = checkpoint.tensors;
    for_each_number(checkpoint.state,
                    [&](const char* key, auto value) { file.metadata[key] = exact_text(value); });
    file.metadata["mask_loss"] = checkpoint.state.mask_loss ? "1" : "0";
    const auto epochs = static_cast<std::int64_t>(checkpoint.state.epoch_losses.size());
    file.tensors[epoch_losses_name] =
        Tensor::from({epochs}, std::span<const double>(checkpoint.state.epoch_losses));
    write_checkpoint_folder(folder, [&](const fs::path& unfinished) {
        model.save(unfinished / model_name);
        write_tensor_file(unfinished / state_name, file);
        write_checksums(unfinished);
    });
}

Checkpoint read_checkpoint(const fs::path& folder, Model& model, std::uint64_t seed) {
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
    for_each_number(checkpoint.state, [&]<class T>(const char* key, T& value) {
        value = state_number<T>(file, source, key);
    });
    if (checkpoint.state.seed != seed)
        fail<FileError>(folder.string(), ": was trained with --seed ", checkpoint.state.seed,
                        ", not ", seed, "; give the same seed");
    checkpoint.state.mask_loss = state_number<int>(file, source, "mask_loss") != 0;
    const auto losses = file.tensors.find(epoch_losses_name);
    if (losses == file.tensors.end())
        fail<FileError>(source, ": not a training state (\"", epoch_losses_name, "\" is missing)");
    checkpoint.state.epoch_losses = losses->second.to_vector();
    // Last, so that an unreadable state leaves the model unchanged.
    model.parameters().load(files.weights, (folder / model_name).string());
    return checkpoint;
}

}  // namespace stymo
