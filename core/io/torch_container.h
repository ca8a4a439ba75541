#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/io/pickle.h"

namespace stymo {

/// The parts of a PyTorch checkpoint, in either of its two formats.
struct TorchContainer {
    Pickle pickle;  ///< the saved object, in which tensors refer to storages
    std::map<std::string, std::string> storages{};  ///< bytes of each storage by its key
};

/// Whether a pickle may name a class or function.
using NameFilter = std::function<bool(const std::string& name)>;
/// Bytes of one element of a storage, from the reference to it. Throws FileError.
using ElementBytes = std::function<std::uint64_t(const PickleNode& reference)>;

/// Reads the zip archive that torch.save has written since 1.6. Throws FileError.
[[nodiscard]] TorchContainer read_torch_zip(const std::filesystem::path& path,
                                            const NameFilter& allowed);

/// Whether a file begins like the format that torch.save wrote before 1.6.
[[nodiscard]] bool is_legacy_torch_file(std::string_view beginning);
/// Reads that format: five pickles, followed by the storages. Throws FileError.
[[nodiscard]] TorchContainer read_legacy_torch_file(const std::filesystem::path& path,
                                                    const NameFilter& allowed,
                                                    const ElementBytes& element_bytes);

/// Throws FileError "path: not a readable PyTorch file (parts)".
template <class... Parts>
[[noreturn]] void refuse_torch_file(const std::filesystem::path& path, const Parts&... parts) {
    fail<FileError>(path.string(), ": not a readable PyTorch file (", parts..., ")");
}

}  // namespace stymo
