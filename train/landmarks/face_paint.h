#pragma once

#include <cstddef>
#include <vector>

#include "core/rng.h"
#include "core/tensor.h"
#include "render/morphable/head.h"

namespace stymo {

/// Random colours for a head without texture: skin, brows, lids, lips, nostrils, folds, beard and
/// hair. Their places are given by the distance to lines through the landmarks of the mean head.
class FacePaint {
public:
    explicit FacePaint(const MorphableHead& head);

    /// Colours of the vertices, (V, 3) RGB in [0.01, 1].
    [[nodiscard]] Tensor draw(Rng rng) const;
    /// A random hair colour, from black to blond, grey and white.
    [[nodiscard]] static Eigen::Vector3d hair_color(Rng& rng);
    /// A random skin colour, from dark to light.
    [[nodiscard]] static Eigen::Vector3d skin_color(Rng& rng);

private:
    using Line = std::vector<Eigen::Vector2d>;
    /// Position of a vertex relative to a line.
    struct Place {
        float along = 0.0F;  ///< 0 at the line's first point, 1 at its last
        float above = 0.0F;  ///< distance, positive above the line
    };
    struct Stroke {
        double width;
        double shift;  ///< upwards
        double taper;  ///< 0: the ends are as wide as the middle
        double opacity;
        Eigen::Vector3d color;
    };
    struct Lines;

    void add_line(const Line& line);
    void stroke(std::vector<Eigen::Vector3d>& colors, std::size_t line, const Stroke& stroke) const;
    void draw_features(std::vector<Eigen::Vector3d>& colors, const Eigen::Vector3d& skin,
                       const Eigen::Vector3d& hair, Rng& rng) const;
    void draw_lips(std::vector<Eigen::Vector3d>& colors, const Eigen::Vector3d& skin,
                   Rng& rng) const;
    void draw_beard(std::vector<Eigen::Vector3d>& colors, const Eigen::Vector3d& hair,
                    Rng& rng) const;
    void draw_hair(std::vector<Eigen::Vector3d>& colors, const Eigen::Vector3d& hair,
                   Rng& rng) const;
    void draw_eyes(std::vector<Eigen::Vector3d>& colors, Rng& rng) const;

    std::vector<Eigen::Vector3d> points_;
    std::vector<HeadPart> parts_;
    std::vector<Eigen::Vector3d> albedo_;
    std::vector<std::size_t> front_;          ///< vertices of the skin of the face
    std::vector<std::vector<Place>> places_;  ///< of `front_`, for each line
    std::vector<float> lip_;                  ///< of `front_`, 1 inside the lips
    std::vector<float> beard_;                ///< of `front_`
    std::vector<float> moustache_;
};

}  // namespace stymo
