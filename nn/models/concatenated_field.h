#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/layers/linear.h"
#include "nn/models/field.h"

namespace stymo {

/// HeadNeRF's field: plain layers with ReLU on [encoded point, geometry code], joined by both once
/// more at the same layer as in RadianceField. Density: a plain layer and softplus(x - 1).
/// Features: a layer without activation, joined by the appearance code, a layer of half the width
/// with ReLU, and a plain one, which for features is applied after compositing and for colours ends
/// in a sigmoid at each sample.
///
/// Unlike HeadNeRF's, the layers have an equalised learning rate (with the gain sqrt(2) before a
/// ReLU), and the density no ReLU.
///
/// Rays go through tile by tile, whose insides the backward pass computes once more: memory does
/// not grow with the samples.
class ConcatenatedField : public Field {
public:
    /// Creates `prefix`.layer0 and so on, `prefix`.density, `prefix`.feature0 to `prefix`.feature2.
    /// Throws ValueError for less than one layer.
    ConcatenatedField(const FieldConfig& config, ParameterStore& store, const std::string& prefix,
                      Rng& rng);

    [[nodiscard]] RenderedFeatures render(const RayPoints& rays, const FieldStyle& style,
                                          bool keep) const override;
    [[nodiscard]] RenderedFeatures render_tracked(const Variable& points, const RayPoints& rays,
                                                  const FieldStyle& style) const override;
    [[nodiscard]] Variable density(const Variable& points, const FieldStyle& style) const override;
    /// The part of a layer that reads a code is computed once for each face and not counted.
    [[nodiscard]] FieldWork work() const override;
    [[nodiscard]] LayerMemory memory(std::int64_t rays, std::int64_t samples_per_ray,
                                     bool keep) const override;

private:
    /// Of one face at points (1, P, 3): what the density and feature layers read, (1, P, width).
    [[nodiscard]] Variable trunk(const Variable& points, const Variable& geometry) const;
    [[nodiscard]] Variable density_of(const Variable& trunk) const;
    /// (1, P, channels) of colours, else (1, P, width / 2), which the last layer follows.
    [[nodiscard]] Variable features_of(const Variable& trunk, const Variable& appearance) const;
    /// Density and features, (P, 1 + ...).
    [[nodiscard]] Variable samples(const Variable& points, const FieldStyle& style) const;
    /// Rays of one face: (1, R, N + 1 + ...), the weights, the transmittance behind them, the
    /// features under the weights.
    [[nodiscard]] Variable composited(const Variable& points, const RayPoints& rays,
                                      const FieldStyle& style) const;

    FieldConfig config_;
    std::int64_t encoding_size_;
    std::vector<Linear> layers_;
    Linear density_;
    Linear feature0_;
    Linear feature1_;
    Linear feature2_;
};

}  // namespace stymo
