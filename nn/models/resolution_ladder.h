#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace stymo {

/// The sides of the images that a model renders and compares, in ascending order. Each side is
/// twice the one before.
class ResolutionLadder {
public:
    /// Throws ValueError unless `smallest` is positive and doubling it zero or more times gives
    /// `largest`.
    ResolutionLadder(std::int64_t smallest, std::int64_t largest);

    [[nodiscard]] const std::vector<std::int64_t>& sides() const { return sides_; }
    [[nodiscard]] std::size_t count() const { return sides_.size(); }
    [[nodiscard]] std::int64_t smallest() const { return sides_.front(); }
    [[nodiscard]] std::int64_t largest() const { return sides_.back(); }
    /// The number of sides up to `side`; 0 stands for the largest. Throws ValueError, which lists
    /// the sides, if `side` is not one of them.
    [[nodiscard]] std::size_t count_up_to(std::int64_t side) const;
    /// The part of the ladder up to this side. Throws like `count_up_to`.
    [[nodiscard]] ResolutionLadder up_to(std::int64_t side) const;
    /// "64, 128, 256"
    [[nodiscard]] std::string text() const;

private:
    std::vector<std::int64_t> sides_;
};

}  // namespace stymo
