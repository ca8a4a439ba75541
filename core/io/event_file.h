#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// A TensorBoard event file: records with masked CRC-32C around protocol-buffer messages, appended one by one and readable while
/// it grows.
class EventFile {
public:
    /// Creates `folder`/events.out.tfevents.<seconds>.stymo. Throws FileError if it cannot be written.
    explicit EventFile(const std::filesystem::path& folder);
    ~EventFile();
    EventFile(EventFile&&) noexcept;

    void scalar(std::int64_t step, std::string_view tag, double value);
    /// picture (h, w, 3) in [0, 1]
    void image(std::int64_t step, std::string_view tag, const Tensor& picture);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
