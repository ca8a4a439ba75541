#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

namespace stymo {

/// Allocates memory that begins on a cache line, so that no vector load crosses two lines.
template <class T>
struct CacheLineAllocator {
    using value_type = T;
    static constexpr std::align_val_t alignment{64};

    CacheLineAllocator() = default;
    template <class Other>
    explicit CacheLineAllocator(const CacheLineAllocator<Other>&) {}

    [[nodiscard]] T* allocate(std::size_t count) {
        return static_cast<T*>(::operator new(count * sizeof(T), alignment));
    }
    void deallocate(T* from, std::size_t) { ::operator delete(from, alignment); }
    [[nodiscard]] bool operator==(const CacheLineAllocator&) const { return true; }
};

template <class T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

/// Resizes a buffer to `size` elements if it has fewer. It never shrinks.
template <class T, class Allocator>
void grow(std::vector<T, Allocator>& buffer, std::int64_t size) {
    if (static_cast<std::int64_t>(buffer.size()) < size)
        buffer.resize(static_cast<std::size_t>(size));
}

}  // namespace stymo
