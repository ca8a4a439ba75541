#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <iosfwd>
#include <span>

namespace stymo {

/// Extents of a tensor, outermost axis first. Rank 0 (a scalar, one element) to 6. Negative axes
/// count from the last one.
class Shape {
public:
    static constexpr int max_rank = 6;

    Shape() = default;
    /// Throws ShapeError for more than `max_rank` axes, a negative extent, or more elements than 64
    /// bits count.
    Shape(std::initializer_list<std::int64_t> extents);
    explicit Shape(std::span<const std::int64_t> extents);

    [[nodiscard]] int rank() const { return rank_; }
    /// Product of all extents.
    [[nodiscard]] std::int64_t size() const;
    /// Extent of `axis`; throws ShapeError if there is no such axis.
    [[nodiscard]] std::int64_t operator[](int axis) const {
        return extents_[static_cast<std::size_t>(index(axis))];
    }
    /// `axis` counted from the first one, in [0, rank); throws ShapeError if there is no such axis.
    [[nodiscard]] int index(int axis) const;
    [[nodiscard]] std::span<const std::int64_t> extents() const {
        return {extents_.data(), static_cast<std::size_t>(rank_)};
    }

    /// The same shape with one extent changed.
    [[nodiscard]] Shape with(int axis, std::int64_t extent) const;
    /// Product of the extents of the axes in [first, last).
    [[nodiscard]] std::int64_t product(int first, int last) const;

    bool operator==(const Shape& other) const;

private:
    void require_countable() const;

    std::array<std::int64_t, max_rank> extents_{};
    int rank_ = 0;
};

/// The shape that both operands broadcast to (extents equal or 1, aligned at the last axis). Throws
/// ShapeError, whose message names `operation`.
[[nodiscard]] Shape broadcast_shape(const Shape& left, const Shape& right, const char* operation);

/// Writes "(2, 3, 4)".
std::ostream& operator<<(std::ostream& stream, const Shape& shape);

}  // namespace stymo
