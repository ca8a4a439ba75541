#pragma once

#include <atomic>
#include <memory>

namespace stymo {

/// Whether this is the only copy of the pointer, so that its owner may write in place.
template <class T>
[[nodiscard]] bool is_sole_owner(const std::shared_ptr<T>& pointer) {
    if (pointer.use_count() != 1) return false;
    // `use_count` is a relaxed load: alone, it does not order the last reads of an owner in another
    // thread before the writes that follow here (P0521, why `shared_ptr::unique` was deprecated).
    // The fence makes the release by which that owner let go happen before them. Processors with
    // weak ordering, such as ARM, need it.
    std::atomic_thread_fence(std::memory_order_acquire);
    return true;
}

}  // namespace stymo
