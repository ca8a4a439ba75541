#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stymo::kernels {

/// Uninitialised scratch memory of the calling thread, one buffer for each T. It spares small
/// products an allocation. 64-byte aligned, and valid until the next call with the same T.
template <class T>
[[nodiscard]] T* scratch_of_thread(std::size_t count) {
    constexpr std::size_t alignment = 64;
    thread_local std::vector<T> room;
    if (room.size() < count + alignment / sizeof(T)) room.resize(count + alignment / sizeof(T));
    const auto address = reinterpret_cast<std::uintptr_t>(room.data());
    return room.data() + (alignment - address % alignment) % alignment / sizeof(T);
}

}  // namespace stymo::kernels
