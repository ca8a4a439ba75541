#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/morphable/head.h"

/// Not part of the public interface.
namespace stymo::morphable {

/// Some vertices of a head, each with all that moves it and its colour side by side.
struct VertexTable {
    VertexTable(const MorphableHead& head, std::vector<std::int32_t> chosen);

    [[nodiscard]] std::size_t size() const { return vertices.size(); }
    /// Row of the shape codes (identity, then expression) of one coordinate.
    [[nodiscard]] std::span<const float> shape_row(std::size_t vertex, std::size_t axis) const;
    [[nodiscard]] std::span<const float> color_row(std::size_t vertex, std::size_t channel) const;

    std::vector<std::int32_t> vertices;
    std::vector<float> mean;         ///< (N, 3)
    std::vector<float> shape;        ///< (N, 3, 179)
    std::vector<float> mean_albedo;  ///< (N, 3)
    std::vector<float> color;        ///< (N, 3, 100)
};

/// World points (N, 3) of a state (state.h).
[[nodiscard]] std::vector<double> table_points(const VertexTable& table, std::span<const double> state);
/// Albedo (N, 3) of a state, not clipped.
[[nodiscard]] std::vector<double> table_albedo(const VertexTable& table, std::span<const double> state);

}  // namespace stymo::morphable
