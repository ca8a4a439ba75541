#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stymo {

/// An interval [begin, end) of pixels in each row of an image, stored one row behind the other from
/// `offset` on.
struct PixelRow {
    std::int64_t begin = 0;
    std::int64_t end = 0;
    std::int64_t offset = 0;

    [[nodiscard]] std::int64_t size() const { return end - begin; }
};

/// Some pixels of a square image, as many rows as the image has.
class PixelRows {
public:
    /// Empties `side` rows.
    void reset(std::int64_t side);
    /// The smallest intervals that hold all non-zero pixels (side * side).
    void set_nonzero(std::span<const std::uint8_t> pixels);
    /// The pixels of the upsampled image that pixels of `rows` reach through the blur of the learnt
    /// upsampling.
    void set_reached(const PixelRows& rows);
    /// The pixels that the learnt upsampling reads where it computes what `rows` reach: `rows` and
    /// their neighbours.
    void set_read(const PixelRows& rows);
    /// `rows`, and what the linear upsampling of RGB and mask make of `below`; from even pixels to
    /// even ones.
    void set_upsampled(const PixelRows& below, const PixelRows& rows);

    [[nodiscard]] std::int64_t side() const { return static_cast<std::int64_t>(rows_.size()); }
    [[nodiscard]] std::int64_t pixels() const { return pixels_; }
    [[nodiscard]] const PixelRow& operator[](std::int64_t row) const {
        return rows_[static_cast<std::size_t>(row)];
    }

private:
    void set(std::int64_t row, std::int64_t begin, std::int64_t end);

    std::vector<PixelRow> rows_;
    std::int64_t pixels_ = 0;
};

}  // namespace stymo
