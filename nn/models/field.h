#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/rng.h"
#include "nn/models/radiance_field.h"

namespace stymo {

/// How codes enter the field.
enum class Conditioning {
    modulation,     ///< identity and expression modulate sine layers; texture and light belong to the render blocks (paper)
    concatenation,  ///< identity and expression join the encoded point, texture and light the features (HeadNeRF)
};

struct FieldConfig {
    Conditioning conditioning = Conditioning::modulation;
    std::int64_t frequencies = 10;
    std::int64_t width = 256;
    std::int64_t layers = 8;
    std::int64_t channels = 256;         ///< of what is composited
    std::int64_t geometry_size = 179;    ///< identity and expression
    std::int64_t appearance_size = 127;  ///< texture and light
    /// The samples have colours between 0 and 1, `channels` of them, instead of features; of a field with concatenation alone.
    bool colors = false;
};

/// The codes that a field may read, in W.
struct FieldStyle {
    Variable geometry;    ///< (B, geometry_size)
    Variable appearance;  ///< (B, appearance_size)
};

struct RenderedFeatures {
    CompositeWeights weights;  ///< (B, R, N)
    Variable features;         ///< (B, R, channels)
};

/// A radiance field with what is composited from it.
class Field {
public:
    virtual ~Field() = default;

    /// `keep`: what the backward pass needs of the samples may be kept instead of computed once more.
    [[nodiscard]] virtual RenderedFeatures render(const RayPoints& rays, const FieldStyle& style, bool keep) const = 0;
    /// The same with points (B, R * N, 3) that gradients flow to, in place of those of `rays`.
    [[nodiscard]] virtual RenderedFeatures render_tracked(const Variable& points, const RayPoints& rays,
                                                          const FieldStyle& style) const = 0;
    /// At points (B, P, 3) in world coordinates: (B, P, 1).
    [[nodiscard]] virtual Variable density(const Variable& points, const FieldStyle& style) const = 0;
    /// For the fast renderer, of one face. Throws ValueError for a field without modulation.
    [[nodiscard]] virtual FoldedField folded(const FieldStyle& style) const = 0;
    [[nodiscard]] virtual FieldWork work() const = 0;
};

/// Creates the field's parameters under `prefix`.
[[nodiscard]] std::unique_ptr<Field> make_field(const FieldConfig& config, ParameterStore& store, const std::string& prefix,
                                                Rng& rng);

}  // namespace stymo
