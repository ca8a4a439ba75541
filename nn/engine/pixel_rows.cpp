#include "nn/engine/pixel_rows.h"

#include <algorithm>

namespace stymo {
namespace {

/// The smallest interval that holds both.
PixelRow hull(const PixelRow& a, const PixelRow& b) {
    if (a.size() == 0) return b;
    if (b.size() == 0) return a;
    return {std::min(a.begin, b.begin), std::max(a.end, b.end), 0};
}

}  // namespace

void PixelRows::reset(std::int64_t side) {
    rows_.assign(static_cast<std::size_t>(side), {});
    pixels_ = 0;
}

void PixelRows::set(std::int64_t row, std::int64_t begin, std::int64_t end) {
    PixelRow& to = rows_[static_cast<std::size_t>(row)];
    to = begin < end ? PixelRow{std::max<std::int64_t>(begin, 0), std::min(end, side()), pixels_}
                     : PixelRow{0, 0, pixels_};
    pixels_ += to.size();
}

void PixelRows::set_nonzero(std::span<const std::uint8_t> pixels) {
    reset(side());
    for (std::int64_t row = 0; row < side(); ++row) {
        const auto in_row = pixels.subspan(static_cast<std::size_t>(row * side()),
                                           static_cast<std::size_t>(side()));
        const auto occupied = [](std::uint8_t pixel) { return pixel != 0; };
        const auto first = std::ranges::find_if(in_row, occupied);
        const auto last = std::find_if(in_row.rbegin(), in_row.rend(), occupied);
        set(row, first - in_row.begin(), in_row.rend() - last);
    }
}

void PixelRows::set_reached(const PixelRows& rows) {
    reset(2 * rows.side());
    for (std::int64_t row = 0; row < side(); ++row) {
        const std::int64_t near =
            std::clamp<std::int64_t>(row % 2 == 0 ? row / 2 - 1 : row / 2 + 1, 0, rows.side() - 1);
        const PixelRow both = hull(rows[row / 2], rows[near]);
        if (both.size() == 0) {
            set(row, 0, 0);
        } else {
            set(row, 2 * both.begin - 1, 2 * both.end + 1);
        }
    }
}

void PixelRows::set_read(const PixelRows& rows) {
    reset(rows.side());
    for (std::int64_t row = 0; row < side(); ++row) {
        PixelRow all = rows[row];
        if (row > 0) all = hull(all, rows[row - 1]);
        if (row + 1 < side()) all = hull(all, rows[row + 1]);
        if (all.size() == 0) {
            set(row, 0, 0);
        } else {
            set(row, all.begin - 1, all.end + 1);
        }
    }
}

void PixelRows::set_upsampled(const PixelRows& below, const PixelRows& rows) {
    reset(rows.side());
    for (std::int64_t row = 0; row < side(); ++row) {
        PixelRow all = below[row / 2];
        for (const std::int64_t y : {row / 2 - 1, row / 2 + 1}) {
            if (y >= 0 && y < below.side()) all = hull(all, below[y]);
        }
        if (all.size() > 0) all = {2 * (all.begin - 1), 2 * (all.end + 1), 0};
        all = hull(all, rows[row]);
        set(row, all.begin / 2 * 2, (all.end + 1) / 2 * 2);
    }
}

}  // namespace stymo
