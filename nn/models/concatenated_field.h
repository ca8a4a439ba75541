#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nn/layers/linear.h"
#include "nn/models/field.h"

namespace stymo {

/// The field of HeadNeRF: linear layers with ReLU on the concatenation [encoded point, geometry
/// code]. This input is concatenated once more to the input of the same layer as in RadianceField.
/// Density: a linear layer and softplus(x - 1). Features: a layer without activation, whose output
/// is concatenated with the appearance code; a layer of half the width with ReLU; a linear layer.
/// For features the last layer is applied after compositing. For colours it is applied at each
/// sample and followed by a sigmoid.
///
/// Unlike in HeadNeRF, the layers have an equalised learning rate (with the gain sqrt(2) before a
/// ReLU), and the density has no ReLU.
///
/// Rays are computed tile by tile. The backward pass computes each tile's activations again, so
/// that memory does not grow with the number of samples.
class ConcatenatedField : public Field {
public:
    /// Creates `prefix`.layer0 and so on, `prefix`.density, `prefix`.feature0 to `prefix`.feature2.
    /// Throws ValueError for fewer than one layer.
    ConcatenatedField(const FieldConfig& config, ParameterStore& store, const std::string& prefix,
                      Rng& rng);

    [[nodiscard]] RenderedFeatures render(const RayPoints& rays, const FieldStyle& style,
                                          bool keep) const override;
    [[nodiscard]] RenderedFeatures render_tracked(const Variable& points, const RayPoints& rays,
                                                  const FieldStyle& style) const override;
    [[nodiscard]] Variable density(const Variable& points, const FieldStyle& style) const override;
    /// Does not count the products with the codes, which are computed once for each face.
    [[nodiscard]] FieldWork work() const override;
    [[nodiscard]] LayerMemory memory(std::int64_t rays, std::int64_t samples_per_ray,
                                     bool keep) const override;

private:
    /// The input of the density and feature layers, (1, P, width), at points (1, P, 3) of one face.
    [[nodiscard]] Variable trunk(const Variable& points, const Variable& geometry) const;
    [[nodiscard]] Variable density_of(const Variable& trunk) const;
    /// Colours (1, P, channels), or the input of the last layer (1, P, width / 2).
    [[nodiscard]] Variable features_of(const Variable& trunk, const Variable& appearance) const;
    /// Density, then features: (P, 1 + channels of `features_of`).
    [[nodiscard]] Variable samples(const Variable& points, const FieldStyle& style) const;
    /// Rays of one face, (1, R, N + 1 + channels of `features_of`): the weights, the transmittance
    /// behind the last sample, the composited features.
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
