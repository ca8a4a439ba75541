#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// A TensorBoard event file: records with masked CRC-32C around protocol-buffer messages, appended one by one and readable while
/// it grows.
class EventFile {
public:
    using Clock = std::function<double()>;  ///< seconds since 1970

    /// Creates `folder`/events.out.tfevents.<seconds>.stymo, with the next second that no file has. Every event bears the time of
    /// `clock` (none: the system's). Throws FileError if it cannot be written, as the others do.
    explicit EventFile(const std::filesystem::path& folder, Clock clock = {});
    ~EventFile();
    EventFile(EventFile&&) noexcept;
    EventFile& operator=(EventFile&&) noexcept;

    void scalar(std::int64_t step, std::string_view tag, double value);
    /// picture (h, w, 3) in [0, 1]
    void image(std::int64_t step, std::string_view tag, const Tensor& picture);
    /// Makes TensorBoard forget what older files of the folder hold from `step` on: a run that was resumed writes it again.
    void restart(std::int64_t step);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
