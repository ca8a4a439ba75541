#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// A TensorBoard event file: protocol-buffer messages in records with masked CRC-32C. Records are
/// appended one by one, and the file is readable while it grows.
class EventFile {
public:
    using Clock = std::function<double()>;  ///< seconds since 1970

    /// Creates `folder`/events.out.tfevents.<seconds>.stymo, with the first second from now on that
    /// no other file uses. Every event has the time of `clock` (default: the system clock). Like
    /// the other functions, throws FileError if the file cannot be written.
    explicit EventFile(const std::filesystem::path& folder, Clock clock = {});
    ~EventFile();
    EventFile(EventFile&&) noexcept;
    EventFile& operator=(EventFile&&) noexcept;

    void scalar(std::int64_t step, std::string_view tag, double value);
    /// image (h, w, 3) in [0, 1]
    void image(std::int64_t step, std::string_view tag, const Tensor& image);
    /// Makes TensorBoard discard the events of older files in the folder from `step` on. A resumed
    /// run writes these events again.
    void restart(std::int64_t step);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
