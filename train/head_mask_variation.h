#pragma once

#include <array>

#include "core/config.h"
#include "core/rng.h"

namespace stymo {

/// How photos are varied for the training of a head-mask network.
struct HeadMaskVariation {
    double background_share = 0.5;  ///< share of the cut-out people that get another background
    double hair_share = 0.3;        ///< share of the photos whose hair is made larger
    double hat_share = 0.03;        ///< share of the photos that get a hat
    double glasses_share = 0.1;     ///< share of the photos that get glasses
    double cover_share = 0.25;      ///< share of the photos with something in front of the head
    double degrees = 20.0;          ///< largest rotation
    double scale = 1.25;            ///< largest enlargement, and 1 / the smallest one
    double shift = 0.08;            ///< largest shift, in units of the side
    double color = 0.3;             ///< strength of changes of brightness, contrast and colour
    double blur_share = 0.35;       ///< share of the photos that lose resolution

    void describe(ConfigSchema& schema);
};

/// A point of an image in units of its side: (0, 0) is the upper left corner, y goes down.
using ImagePoint = std::array<double, 2>;

/// A map of the points of a varied image to those of its source: turned, scaled, shifted, mirrored.
class ImagePlacement {
public:
    /// At most `degrees` turned, `scale` times as large or as small, and `shift` sides moved.
    ImagePlacement(double degrees, double scale, double shift, Rng& rng);

    [[nodiscard]] ImagePoint source(const ImagePoint& point) const;

private:
    double cosine_, sine_, x_, y_;
    bool mirrored_;
};

/// A map of the points of an aligned photo (FFHQ's square) whose hair and ears were stretched away
/// from the face, by another factor in each direction, to those of the photo as it was.
class LargerHair {
public:
    explicit LargerHair(Rng& rng);

    [[nodiscard]] ImagePoint source(const ImagePoint& point) const;

private:
    struct Wave {
        double frequency, phase, height;
    };
    double logarithm_;  ///< of the largest factor
    std::array<Wave, 4> waves_;
};

/// A hat on the head of an aligned photo: a crown and a brim.
class Hat {
public:
    enum class Part {
        none,
        shadow,   ///< on the face, below the brim
        hat,      ///< of the hat
        outside,  ///< beside and above the hat, where hair would be pressed down
    };

    explicit Hat(Rng& rng);

    [[nodiscard]] Part part(const ImagePoint& point) const;

private:
    double x_, brim_, tilt_, width_, crown_top_, taper_, brim_width_, thickness_, bend_, shadow_;
};

/// Glasses before the eyes of an aligned photo, most of them dark: two lenses, frame and temples.
class Glasses {
public:
    explicit Glasses(Rng& rng);

    /// Colour and opacity at a point, all in [0, 1]. `temple`: of a thin bar towards an ear, which
    /// is only seen on the head.
    struct Paint {
        std::array<float, 3> color{};
        float opacity = 0.0F;
        bool temple = false;
    };
    [[nodiscard]] Paint paint(const ImagePoint& point) const;

private:
    double tilt_, middle_, height_, apart_, lens_width_, lens_height_, roundness_, rim_;
    float opacity_, fade_;
    std::array<float, 3> lens_{}, frame_{};
};

/// Changes the exposure and the balance of colours, and takes some of the colour away.
class ColorChange {
public:
    ColorChange(double strength, Rng& rng);

    /// Of red, green and blue in [0, 1].
    [[nodiscard]] std::array<float, 3> operator()(const std::array<float, 3>& color) const;

private:
    float gamma_;
    float saturation_;
    std::array<float, 3> gains_{};
};

}  // namespace stymo
