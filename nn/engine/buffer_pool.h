#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace stymo {

/// Hands out buffers, the ones used last first.
template <class Buffers>
class BufferPool {
public:
    /// Makes buffers until there are `count`, and calls prepare(buffers) for each of them. None may
    /// be taken at that time.
    template <class Prepare>
    void fill(std::int64_t count, Prepare prepare) {
        while (std::ssize(free_) < count) free_.push_back(std::make_unique<Buffers>());
        for (const std::unique_ptr<Buffers>& buffers : free_) prepare(*buffers);
    }
    /// At most as many at once as there are.
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
