#include "core/io/element_type.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace stymo {
namespace {

static_assert(std::endian::native == std::endian::little,
              "weight files are little-endian and read in place");

template <class Source>
float widened(Source value) {
    return static_cast<float>(value);
}

struct Half {
    std::uint16_t bits;
};
struct BrainFloat {
    std::uint16_t bits;
};

float widened(BrainFloat value) {
    return std::bit_cast<float>(std::uint32_t{value.bits} << 16);
}

float widened(Half value) {
    const std::uint32_t sign = (value.bits & 0x8000U) << 16;
    const std::uint32_t exponent = (value.bits >> 10) & 0x1FU;
    const std::uint32_t fraction = value.bits & 0x3FFU;
    if (exponent == 0) {
        // Subnormal halves are multiples of 2^-24, which float32 holds exactly.
        const float magnitude = static_cast<float>(fraction) * 0x1.0p-24F;
        return sign != 0 ? -magnitude : magnitude;
    }
    const std::uint32_t wide_exponent = exponent == 0x1F ? 0xFFU : exponent + 127 - 15;
    return std::bit_cast<float>(sign | (wide_exponent << 23) | (fraction << 13));
}

template <class Source>
Tensor convert(const Shape& shape, const char* data) {
    Tensor result(shape);
    for (float& value : result.mutable_values<float>()) {
        Source source;
        std::memcpy(&source, data, sizeof source);
        data += sizeof source;
        value = widened(source);
    }
    return result;
}

template <class Value>
Tensor copy(const Shape& shape, const char* data) {
    Tensor result(shape, dtype_of<Value>());
    const auto values = result.mutable_values<Value>();
    if (!values.empty()) std::memcpy(values.data(), data, values.size_bytes());
    return result;
}

constexpr ElementType element_types[] = {
    {"F32", 4, copy<float>},
    {"F64", 8, copy<double>},
    {"F16", 2, convert<Half>},
    {"BF16", 2, convert<BrainFloat>},
    {"I8", 1, convert<std::int8_t>},
    {"I16", 2, convert<std::int16_t>},
    {"I32", 4, convert<std::int32_t>},
    {"I64", 8, convert<std::int64_t>},
    {"U8", 1, convert<std::uint8_t>},
    {"U16", 2, convert<std::uint16_t>},
    {"U32", 4, convert<std::uint32_t>},
    {"U64", 8, convert<std::uint64_t>},
    {"BOOL", 1, convert<std::uint8_t>},
};

}  // namespace

const ElementType* find_element_type(std::string_view name) {
    const auto* type = std::ranges::find(element_types, name, &ElementType::name);
    return type == std::end(element_types) ? nullptr : type;
}

std::optional<std::int64_t> checked_element_count(std::span<const std::int64_t> extents) {
    std::int64_t bytes = 8;
    for (const std::int64_t extent : extents) {
        if (extent < 0 || __builtin_mul_overflow(bytes, extent, &bytes)) return std::nullopt;
    }
    return bytes / 8;
}

}  // namespace stymo
