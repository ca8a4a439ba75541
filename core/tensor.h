#pragma once

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "core/shape.h"

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

/// A contiguous row-major array of float32 or float64; images are NHWC, points are (rows,
/// channels).
///
/// A value type with copy on write: copies share the buffer until one of them is written to, so the
/// elements of one copy never change through another. A Tensor has no gradients; see Variable.
class Tensor {
public:
    /// An undefined tensor without elements and buffer; `defined()` is false.
    Tensor() = default;
    /// Uninitialised elements.
    explicit Tensor(Shape shape, DType dtype = DType::float32);

    [[nodiscard]] static Tensor full(const Shape& shape, double value,
                                     DType dtype = DType::float32);
    [[nodiscard]] static Tensor zeros(const Shape& shape, DType dtype = DType::float32) {
        return full(shape, 0.0, dtype);
    }
    [[nodiscard]] static Tensor scalar(double value, DType dtype = DType::float32) {
        return full({}, value, dtype);
    }
    /// Throws ShapeError if the number of values is not the shape's size.
    [[nodiscard]] static Tensor from(const Shape& shape, std::span<const float> values);
    [[nodiscard]] static Tensor from(const Shape& shape, std::span<const double> values);
    /// A tensor over elements in row-major order that `elements` keeps alive, such as those of
    /// another library's array. Whoever owns them leaves them as they are while tensors use them.
    [[nodiscard]] static Tensor over(const Shape& shape, DType dtype,
                                     std::shared_ptr<std::byte[]> elements);

    [[nodiscard]] bool defined() const { return buffer_ != nullptr; }
    [[nodiscard]] const Shape& shape() const { return shape_; }
    [[nodiscard]] std::int64_t shape(int axis) const { return shape_[axis]; }
    [[nodiscard]] int rank() const { return shape_.rank(); }
    [[nodiscard]] std::int64_t size() const { return defined() ? shape_.size() : 0; }
    [[nodiscard]] DType dtype() const { return dtype_; }

    /// Elements in row-major order. Throws TypeError if T is not the tensor's type, ValueError if
    /// the tensor is undefined.
    template <class T>
    [[nodiscard]] std::span<const T> values() const;
    /// Writable elements; copies the buffer first if another tensor shares it.
    template <class T>
    [[nodiscard]] std::span<T> mutable_values();

    /// The same elements seen with another shape; the buffer stays shared. Throws ShapeError if the
    /// sizes differ.
    [[nodiscard]] Tensor reshaped(const Shape& shape) const;
    [[nodiscard]] Tensor to(DType dtype) const;
    /// The only element of a tensor of size 1; throws ShapeError otherwise.
    [[nodiscard]] double item() const;
    [[nodiscard]] std::vector<double> to_vector() const;
    /// True if no element is infinite or not a number.
    [[nodiscard]] bool all_finite() const;

private:
    void require(DType dtype) const;

    std::shared_ptr<std::byte[]> buffer_;
    Shape shape_;
    DType dtype_ = DType::float32;
};

}  // namespace stymo
