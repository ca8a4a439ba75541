#pragma once

#include <filesystem>
#include <functional>

/// Folders of checkpoints that survive a crash at any moment: beside `folder` stand, for a while, `folder`.unfinished, which is
/// being written, and `folder`.replaced, which was complete before.
namespace stymo {

/// Calls `write(unfinished)` and puts what it wrote in the place of `folder`. Throws FileError if a name cannot be changed;
/// an older checkpoint of this name is kept then.
void write_checkpoint_folder(const std::filesystem::path& folder, const std::function<void(const std::filesystem::path&)>& write);
/// Removes a checkpoint; a crash leaves an unfinished one rather than half of a complete one.
void remove_checkpoint_folder(const std::filesystem::path& folder);
/// Puts right what a crash left of one checkpoint: the older one comes back if no new one has taken its place.
void repair_checkpoint_folder(const std::filesystem::path& folder);
/// The same for every checkpoint in `folder`; unfinished ones go.
void repair_checkpoint_folders(const std::filesystem::path& folder);

}  // namespace stymo
