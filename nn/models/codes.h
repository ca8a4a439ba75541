#pragma once

#include <array>
#include <cstdint>

#include "core/autograd/variable.h"

namespace stymo {

/// The four groups of the code in their fixed order, with their sizes (paper: 100, 79, 100, 27; 306
/// elements in all).
inline constexpr std::array<const char*, 4> code_names{"id", "expr", "tex", "light"};
inline constexpr std::array<std::int64_t, 4> code_sizes{100, 79, 100, 27};
inline constexpr std::int64_t code_size = 306;

/// Codes of B faces, in Z or in W space: one (B, size) value for each group, in the order of
/// `code_names`.
struct Codes {
    std::array<Variable, 4> groups;

    [[nodiscard]] const Variable& identity() const { return groups[0]; }
    [[nodiscard]] const Variable& expression() const { return groups[1]; }
    [[nodiscard]] const Variable& texture() const { return groups[2]; }
    [[nodiscard]] const Variable& light() const { return groups[3]; }
    [[nodiscard]] std::int64_t batch() const { return groups[0].shape(0); }
};

/// The groups of each face concatenated in their order, (B, 306).
[[nodiscard]] Variable joined(const Codes& codes);
/// The inverse of `joined`. Throws ShapeError for rows of another length.
[[nodiscard]] Codes split_codes(const Variable& rows);
/// The codes of face `index`: (1, size) for each group.
[[nodiscard]] Codes codes_of_face(const Codes& codes, std::int64_t index);
/// a + b, group by group.
[[nodiscard]] Codes add(const Codes& a, const Codes& b);
/// The same values as constants, to which no gradient flows.
[[nodiscard]] Codes detached(const Codes& codes);
/// The sum of the squares of all elements of all faces, a scalar.
[[nodiscard]] Variable squared_length(const Codes& codes);

}  // namespace stymo
