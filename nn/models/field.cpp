#include "nn/models/field.h"

#include "core/ops/reduce.h"
#include "nn/models/concatenated_field.h"

namespace stymo {
namespace {

class ModulatedField : public Field {
public:
    ModulatedField(const FieldConfig& config, ParameterStore& store, const std::string& prefix, Rng& rng)
        : field_({.frequencies = config.frequencies,
                  .width = config.width,
                  .layers = config.layers,
                  .feature_channels = config.channels,
                  .style_size = config.geometry_size},
                 store, prefix, rng) {}

    [[nodiscard]] RenderedFeatures render(const RayPoints& rays, const FieldStyle& style, bool keep) const override {
        return finished(field_.render(rays, style.geometry, keep ? SineArguments::kept : SineArguments::recomputed));
    }
    [[nodiscard]] RenderedFeatures render_tracked(const Variable& points, const RayPoints& rays,
                                                  const FieldStyle& style) const override {
        return finished(field_.render_tracked(points, rays, style.geometry));
    }
    [[nodiscard]] Variable density(const Variable& points, const FieldStyle& style) const override {
        return field_(points, style.geometry, true).density;
    }
    [[nodiscard]] FoldedField folded(const FieldStyle& style) const override { return field_.folded(style.geometry); }
    [[nodiscard]] FieldWork work() const override { return field_.work(); }

private:
    [[nodiscard]] RenderedFeatures finished(RenderedRays rays) const {
        const Variable features = field_.finish(rays.composited, sum(rays.weights.weights, {2}));
        return {std::move(rays.weights), features};
    }

    RadianceField field_;
};

}  // namespace

std::unique_ptr<Field> make_field(const FieldConfig& config, ParameterStore& store, const std::string& prefix, Rng& rng) {
    if (config.conditioning == Conditioning::concatenation)
        return std::make_unique<ConcatenatedField>(config, store, prefix, rng);
    return std::make_unique<ModulatedField>(config, store, prefix, rng);
}

}  // namespace stymo
