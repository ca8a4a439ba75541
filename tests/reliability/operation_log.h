#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace stymo {

/// What a program did to a file or folder, as preload/write_recorder.cpp wrote it down.
struct Operation {
    enum class Kind {
        make_file,    ///< `number` appears at `path`
        make_folder,  ///< `number` appears at `path`
        write,        ///< `bytes` at `offset` of `number`
        resize,       ///< `number` has `offset` bytes
        flush,        ///< `number` is on the disk: its bytes, or the names in it
        rename,       ///< from `path` to `target`
        link,         ///< `target` is a second name of `path`
        remove,       ///< `path`
    };
    Kind kind;
    std::uint64_t number =
        0;  ///< of the file or folder; one that is removed may give it to another
    std::string path, target;  ///< below the recorded folder
    std::uint64_t offset = 0;
    std::string bytes;
    std::size_t order = 0;  ///< position in the log
};

/// Reads a log; throws FileError if it is malformed.
[[nodiscard]] std::vector<Operation> read_operation_log(const std::filesystem::path& log);

}  // namespace stymo
