#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stymo {

/// The interval [begin, end) of pixels in one row of an image. `offset` is the number of pixels in
/// the intervals of all rows before it, that is, the index of its first pixel in packed storage.
struct PixelRow {
    std::int64_t begin = 0;
    std::int64_t end = 0;
    std::int64_t offset = 0;

    [[nodiscard]] std::int64_t size() const { return end - begin; }
};

/// A set of pixels of a square image: one interval in each row.
class PixelRows {
public:
    /// Makes `side` empty rows.
    void reset(std::int64_t side);
    /// Sets the smallest intervals that hold all non-zero elements of `pixels` (side, side).
    void set_nonzero(std::span<const std::uint8_t> pixels);
    /// Sets the pixels of the image of twice the side whose value depends on pixels of `rows`
    /// through the learnt upsampling with its blur.
    void set_reached(const PixelRows& rows);
    /// Sets the pixels that the learnt upsampling reads to compute the pixels of
    /// `set_reached(rows)`: the pixels of `rows` and their neighbours.
    void set_read(const PixelRows& rows);
    /// Sets the union of `rows` and of the pixels that depend on `below` through the linear
    /// upsampling of RGB and mask. Each interval begins and ends at an even pixel.
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
