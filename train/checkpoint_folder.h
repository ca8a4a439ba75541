#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

/// Checkpoint folders that survive a crash or a power cut at any moment. While `folder` is written,
/// two more can exist: `folder`.unfinished is being written, and `folder`.replaced is the complete
/// checkpoint that it takes the place of.
namespace stymo {

/// The step in the name of a checkpoint's folder, or nothing for another name.
[[nodiscard]] std::optional<std::int64_t> checkpoint_step(const std::filesystem::path& folder);
/// Calls `write(unfinished)` and puts what it wrote in the place of `folder`. Throws FileError if a
/// folder cannot be renamed; an older checkpoint of this name is kept then.
void write_checkpoint_folder(const std::filesystem::path& folder,
                             const std::function<void(const std::filesystem::path&)>& write);
/// Removes a checkpoint; a crash leaves an unfinished one rather than half of a complete one.
void remove_checkpoint_folder(const std::filesystem::path& folder);
/// Repairs one checkpoint after a crash: restores the replaced one if no new one is complete.
void repair_checkpoint_folder(const std::filesystem::path& folder);
/// Repairs every checkpoint in `folder` and removes unfinished ones.
void repair_checkpoint_folders(const std::filesystem::path& folder);

}  // namespace stymo
