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

/// The parts of a PyTorch checkpoint, whichever of its two formats it has.
struct TorchContainer {
    Pickle pickle;                                  ///< what was saved; tensors refer to storages
    std::map<std::string, std::string> storages{};  ///< bytes of each storage by its key
};

/// Tells if a pickle may name a class or function.
using NameFilter = std::function<bool(const std::string& name)>;
/// Bytes of one element of a storage, told by the reference to it. Throws FileError.
using ElementBytes = std::function<std::uint64_t(const PickleNode& reference)>;

/// The zip archive that torch.save has written since 1.6. Throws FileError.
[[nodiscard]] TorchContainer read_torch_zip(const std::filesystem::path& path, const NameFilter& allowed);

/// True if a file begins as the format before 1.6 does.
[[nodiscard]] bool is_legacy_torch_file(std::string_view beginning);
/// That format: five pickles and the storages one after the other. Throws FileError.
[[nodiscard]] TorchContainer read_legacy_torch_file(const std::filesystem::path& path, const NameFilter& allowed,
                                                    const ElementBytes& element_bytes);

/// Throws FileError "path: not a readable PyTorch file (parts)".
template <class... Parts>
[[noreturn]] void refuse_torch_file(const std::filesystem::path& path, const Parts&... parts) {
    fail<FileError>(path.string(), ": not a readable PyTorch file (", parts..., ")");
}

}  // namespace stymo
