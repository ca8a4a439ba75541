#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

/// Checkpoint folders that survive a crash or a power cut at any time. While `folder` is being
/// written, two more folders can exist: `folder`.unfinished is the new checkpoint, and
/// `folder`.replaced is the complete one that it replaces.
namespace stymo {

/// The step in the name of a checkpoint's folder, or nothing for another name.
[[nodiscard]] std::optional<std::int64_t> checkpoint_step(const std::filesystem::path& folder);
/// Calls `write(unfinished)` and replaces `folder` by the result. Throws FileError if a folder
/// cannot be renamed; the older checkpoint of this name is then kept.
void write_checkpoint_folder(const std::filesystem::path& folder,
                             const std::function<void(const std::filesystem::path&)>& write);
/// Removes a checkpoint. After a crash a partly removed checkpoint is named as unfinished, never as
/// complete.
void remove_checkpoint_folder(const std::filesystem::path& folder);
/// Repairs one checkpoint after a crash: restores the replaced one if no new one is complete.
void repair_checkpoint_folder(const std::filesystem::path& folder);
/// Repairs every checkpoint in `folder` and removes unfinished ones.
void repair_checkpoint_folders(const std::filesystem::path& folder);

}  // namespace stymo
