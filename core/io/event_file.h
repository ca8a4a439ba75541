#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// A TensorBoard event file: records with masked CRC-32C around protocol-buffer messages, appended
/// one by one and readable while it grows.
class EventFile {
public:
    using Clock = std::function<double()>;  ///< seconds since 1970

    /// Creates `folder`/events.out.tfevents.<seconds>.stymo, with the next second that no file has.
    /// Every event has the time of `clock` (default: the system's). Throws FileError if the file
    /// cannot be written, as the other functions do.
    explicit EventFile(const std::filesystem::path& folder, Clock clock = {});
    ~EventFile();
    EventFile(EventFile&&) noexcept;
    EventFile& operator=(EventFile&&) noexcept;

    void scalar(std::int64_t step, std::string_view tag, double value);
    /// image (h, w, 3) in [0, 1]
    void image(std::int64_t step, std::string_view tag, const Tensor& image);
    /// Makes TensorBoard discard the events of older files in the folder from `step` on, because a
    /// resumed run writes them again.
    void restart(std::int64_t step);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
