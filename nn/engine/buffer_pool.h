#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace stymo {

/// A pool of buffers. `take` and `give_back` are thread-safe. The buffer that was given back last
/// is handed out first.
template <class Buffers>
class BufferPool {
public:
    /// Adds buffers until the pool holds `count`, and calls prepare(buffers) for all of them. No
    /// buffer may be in use during the call.
    template <class Prepare>
    void fill(std::int64_t count, Prepare prepare) {
        while (std::ssize(free_) < count) free_.push_back(std::make_unique<Buffers>());
        for (const std::unique_ptr<Buffers>& buffers : free_) prepare(*buffers);
    }
    /// The caller must not take more buffers at once than the pool holds.
    [[nodiscard]] std::unique_ptr<Buffers> take() {
        const std::scoped_lock lock(mutex_);
        std::unique_ptr<Buffers> buffers = std::move(free_.back());
        free_.pop_back();
        return buffers;
    }
    void give_back(std::unique_ptr<Buffers> buffers) {
        const std::scoped_lock lock(mutex_);
        free_.push_back(std::move(buffers));
    }

private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<Buffers>> free_;
};

}  // namespace stymo
