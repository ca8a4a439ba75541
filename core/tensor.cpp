#include "core/tensor.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <ostream>

#include "core/error.h"
#include "core/sole_owner.h"
#include "core/work_counts.h"

namespace stymo {

std::ostream& operator<<(std::ostream& stream, DType dtype) {
    return stream << (dtype == DType::float32 ? "float32" : "float64");
}

namespace {

constexpr std::size_t alignment = 64;  // a cache line and the widest vector register

/// Aligned by hand, because glibc before 2.38 does not reuse a freed aligned_alloc block for a
/// request of the same size: the heap would grow and every op would pay for fresh pages.
std::shared_ptr<std::byte[]> allocate(std::size_t bytes) {
    void* const block = std::malloc(bytes + alignment);
    if (block == nullptr) throw std::bad_alloc();
    void* aligned = block;
    std::size_t space = bytes + alignment;
    std::align(alignment, bytes, aligned, space);
    const auto counted = static_cast<std::int64_t>(bytes);
    work::count_buffer(counted);
    return {static_cast<std::byte*>(aligned), [block, counted](std::byte*) {
                std::free(block);
                work::count_release(counted);
            }};
}

template <class T>
Tensor from_values(const Shape& shape, std::span<const T> values) {
    if (shape.size() != static_cast<std::int64_t>(values.size()))
        fail<ShapeError>("[tensor] ", values.size(), " values for shape ", shape);
    Tensor result(shape, dtype_of<T>());
    std::ranges::copy(values, result.mutable_values<T>().begin());
    return result;
}

std::size_t bytes_of(const Shape& shape, DType dtype) {
    std::int64_t bytes = 0;
    if (__builtin_mul_overflow(shape.size(), static_cast<std::int64_t>(size_in_bytes(dtype)),
                               &bytes))
        fail<ShapeError>("[tensor] ", shape, " is too large");
    return static_cast<std::size_t>(bytes);
}

}  // namespace

Tensor::Tensor(Shape shape, DType dtype)
    : buffer_(allocate(bytes_of(shape, dtype))), shape_(shape), dtype_(dtype) {}

Tensor Tensor::full(const Shape& shape, double value, DType dtype) {
    Tensor result(shape, dtype);
    dispatch(dtype, [&]<class T>(T) {
        std::ranges::fill(result.mutable_values<T>(), static_cast<T>(value));
    });
    return result;
}

Tensor Tensor::from(const Shape& shape, std::span<const float> values) {
    return from_values(shape, values);
}
Tensor Tensor::from(const Shape& shape, std::span<const double> values) {
    return from_values(shape, values);
}

Tensor Tensor::over(const Shape& shape, DType dtype, std::shared_ptr<std::byte[]> elements) {
    Tensor result;
    result.buffer_ = std::move(elements);
    result.shape_ = shape;
    result.dtype_ = dtype;
    return result;
}

void Tensor::require(DType dtype) const {
    if (!defined()) fail<ValueError>("[tensor] an undefined tensor has no values");
    if (dtype != dtype_)
        fail<TypeError>("[tensor] expected ", dtype, ", got ", dtype_, "; convert with to()");
}

template <class T>
std::span<const T> Tensor::values() const {
    require(dtype_of<T>());
    return {reinterpret_cast<const T*>(buffer_.get()), static_cast<std::size_t>(shape_.size())};
}

template <class T>
std::span<T> Tensor::mutable_values() {
    require(dtype_of<T>());
    const auto count = static_cast<std::size_t>(shape_.size());
    if (!is_sole_owner(buffer_)) {
        auto copy = allocate(count * sizeof(T));
        std::memcpy(copy.get(), buffer_.get(), count * sizeof(T));
        buffer_ = std::move(copy);
    }
    return {reinterpret_cast<T*>(buffer_.get()), count};
}

template std::span<const float> Tensor::values<float>() const;
template std::span<const double> Tensor::values<double>() const;
template std::span<float> Tensor::mutable_values<float>();
template std::span<double> Tensor::mutable_values<double>();

Tensor Tensor::reshaped(const Shape& shape) const {
    if (shape.size() != shape_.size())
        fail<ShapeError>("[reshape] ", shape_, " has ", shape_.size(), " elements, ", shape,
                         " has ", shape.size());
    Tensor result = *this;
    result.shape_ = shape;
    return result;
}

Tensor Tensor::to(DType dtype) const {
    if (dtype == dtype_ || !defined()) return *this;
    Tensor result(shape_, dtype);
    dispatch(dtype_, [&]<class From>(From) {
        dispatch(dtype, [&]<class To>(To) {
            std::ranges::transform(values<From>(), result.mutable_values<To>().begin(),
                                   [](From value) { return static_cast<To>(value); });
        });
    });
    return result;
}

double Tensor::item() const {
    if (size() != 1) fail<ShapeError>("[item] needs one element, got shape ", shape_);
    return dispatch(dtype_, [&]<class T>(T) { return static_cast<double>(values<T>().front()); });
}

std::vector<double> Tensor::to_vector() const {
    return dispatch(dtype_, [&]<class T>(T) {
        const auto elements = values<T>();
        return std::vector<double>(elements.begin(), elements.end());
    });
}

bool Tensor::all_finite() const {
    return dispatch(dtype_, [&]<class T>(T) {
        const std::span<const T> elements = values<T>();
        constexpr std::size_t block = 4096;
        for (std::size_t begin = 0; begin < elements.size(); begin += block) {
            const std::size_t end = std::min(elements.size(), begin + block);
            int outside = 0;  // not a bool, whose reduction is not vectorised
#pragma omp simd reduction(| : outside)
            for (std::size_t i = begin; i < end; ++i)
                outside |= std::abs(elements[i]) <= std::numeric_limits<T>::max() ? 0 : 1;
            if (outside != 0) return false;
        }
        return true;
    });
}

}  // namespace stymo
