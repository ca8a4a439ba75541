#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/tool_run.h"
#include "core/io/scratch_folder.h"

namespace stymo {

/// A tool whose calls are to fail, on as little data as has all of its files.
struct ShortJob {
    std::string name;
    std::string command;  ///< ends with the option of the output folder
    /// The command that goes on from what is in the output folder.
    std::function<std::string(const std::filesystem::path& out)> command_to_finish;
    /// Compares a finished output folder with that of an undisturbed run.
    std::function<void(const std::filesystem::path& out)> compare;
    std::filesystem::path beginning;  ///< copied to the output folder first, unless empty
};

/// The folder in which the commands run; made at the first call, by copies of this process.
[[nodiscard]] const std::filesystem::path& short_data();

/// Three steps of training: one of stage 1, one in each of two phases of stage 2.
[[nodiscard]] ShortJob training();
/// The same from the checkpoint after the first step.
[[nodiscard]] ShortJob resumed_training();
[[nodiscard]] ShortJob fitting();
[[nodiscard]] ShortJob preparation();

}  // namespace stymo
