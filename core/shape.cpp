#include "core/shape.h"

#include <algorithm>
#include <ostream>

#include "core/error.h"

namespace stymo {

Shape::Shape(std::initializer_list<std::int64_t> extents)
    : Shape(std::span(extents.begin(), extents.size())) {}

Shape::Shape(std::span<const std::int64_t> extents) {
    if (extents.size() > max_rank)
        fail<ShapeError>("[shape] ", extents.size(), " axes; at most ", max_rank, " are supported");
    rank_ = static_cast<int>(extents.size());
    std::copy(extents.begin(), extents.end(), extents_.begin());
    require_countable();
}

void Shape::require_countable() const {
    if (std::ranges::any_of(extents(), [](std::int64_t extent) { return extent < 0; }))
        fail<ShapeError>("[shape] negative extent in ", *this);
    if (std::ranges::count(extents(), 0) > 0) return;
    std::int64_t elements = 1;
    for (const std::int64_t extent : extents())
        if (__builtin_mul_overflow(elements, extent, &elements))
            fail<ShapeError>("[shape] ", *this, " is too large: 64 bits do not count its elements");
}

std::int64_t Shape::size() const {
    return product(0, rank_);
}

int Shape::index(int axis) const {
    const int from_front = axis < 0 ? axis + rank_ : axis;
    if (from_front < 0 || from_front >= rank_)
        fail<ShapeError>("[shape] no axis ", axis, " in ", *this);
    return from_front;
}

Shape Shape::with(int axis, std::int64_t extent) const {
    Shape changed = *this;
    changed.extents_[static_cast<std::size_t>(index(axis))] = extent;
    changed.require_countable();
    return changed;
}

std::int64_t Shape::product(int first, int last) const {
    // Beside an extent of 0 the others may be of any size; their product then wraps.
    std::uint64_t result = 1;
    for (int axis = first; axis < last; ++axis)
        result *= static_cast<std::uint64_t>(extents_[static_cast<std::size_t>(axis)]);
    return static_cast<std::int64_t>(result);
}

bool Shape::operator==(const Shape& other) const {
    return std::ranges::equal(extents(), other.extents());
}

Shape broadcast_shape(const Shape& left, const Shape& right, const char* operation) {
    Shape result = left.rank() >= right.rank() ? left : right;
    for (int axis = 1; axis <= result.rank(); ++axis) {
        const std::int64_t a = axis <= left.rank() ? left[-axis] : 1;
        const std::int64_t b = axis <= right.rank() ? right[-axis] : 1;
        if (a != b && a != 1 && b != 1) {
            fail<ShapeError>("[", operation, "] shapes ", left, " and ", right,
                             " do not broadcast: axis -", axis, " has ", a, " and ", b);
        }
        result = result.with(-axis, a == 1 ? b : a);
    }
    return result;
}

std::ostream& operator<<(std::ostream& stream, const Shape& shape) {
    stream << '(';
    for (int axis = 0; axis < shape.rank(); ++axis)
        stream << (axis > 0 ? ", " : "") << shape.extents()[static_cast<std::size_t>(axis)];
    return stream << ')';
}

}  // namespace stymo
