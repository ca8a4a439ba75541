#pragma once

#include <charconv>
#include <string>

#include "core/error.h"
#include "core/io/tensor_file.h"

namespace stymo {

/// The number under `key` in the metadata of a training's state. Throws FileError, which names
/// `source`, if it is missing or no number.
template <class T>
[[nodiscard]] T state_number(const TensorFile& file, const std::string& source, const char* key) {
    const auto found = file.metadata.find(key);
    if (found == file.metadata.end())
        fail<FileError>(source, ": not a training state (\"", key, "\" is missing)");
    const std::string& text = found->second;
    T value{};
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (end.ec != std::errc{} || end.ptr != text.data() + text.size())
        fail<FileError>(source, ": \"", key, "\" is \"", text, "\", not a number");
    return value;
}

}  // namespace stymo
