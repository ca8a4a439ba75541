#pragma once

#include <cstddef>
#include <iosfwd>
#include <type_traits>

namespace stymo {

/// Element type of a tensor, chosen at run time.
enum class DType : unsigned char { float32, float64 };

[[nodiscard]] constexpr std::size_t size_in_bytes(DType dtype) {
    return dtype == DType::float32 ? sizeof(float) : sizeof(double);
}

template <class T>
[[nodiscard]] constexpr DType dtype_of() {
    static_assert(std::is_same_v<T, float> || std::is_same_v<T, double>);
    return std::is_same_v<T, float> ? DType::float32 : DType::float64;
}

/// Calls `visitor(T{})` with T = float or double. Only this function converts the run-time type to
/// a compile-time type.
template <class Visitor>
decltype(auto) dispatch(DType dtype, Visitor&& visitor) {
    return dtype == DType::float32 ? visitor(float{}) : visitor(double{});
}

std::ostream& operator<<(std::ostream& stream, DType dtype);

}  // namespace stymo
