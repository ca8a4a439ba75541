#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "nn/realtime/face_renderer.h"
#include "nn/realtime/field_source.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// A square map from one letter for each ray: '#' opaque, '+' faint, '.' empty.
FeatureMap map_of(const std::string& picture) {
    FeatureMap map;
    for (const char ray : picture) {
        map.opacities.push_back(ray == '#' ? 0.9F : ray == '+' ? 0.05F : 0.0F);
        map.occupied.push_back(ray == '.' ? 0 : 1);
        map.depths.push_back(5.0F);
        map.features.insert(map.features.end(), 2, 1.0F);
    }
    return map;
}

std::string picture_of(const FeatureMap& map) {
    std::string picture;
    for (std::size_t ray = 0; ray < map.occupied.size(); ++ray) {
        const bool removed = map.features[2 * ray] == 0.0F && map.features[2 * ray + 1] == 0.0F &&
                             map.occupied[ray] == 0 && map.opacities[ray] == 0.0F &&
                             map.depths[ray] == 9.0F;
        picture += removed                     ? ' '
                   : map.opacities[ray] > 0.5F ? '#'
                   : map.occupied[ray] != 0    ? '+'
                                               : '.';
    }
    return picture;
}

std::string without_floaters(const std::string& picture, std::int64_t side) {
    FeatureMap map = map_of(picture);
    FloaterRemoval().apply(map, side, 9.0);
    return picture_of(map);
}

}  // namespace

TEST_CASE("Of the pieces of a view the largest one stays, each with its faint rim", "[realtime]") {
    CHECK(without_floaters(".+..."
                           "+##+."
                           "+##.+"
                           ".++.#"
                           "....+",
                           5) ==
          ".+..."
          "+##+."
          "+##. "
          ".++. "
          ".... ");
    // Rays that touch at a corner belong together.
    const std::string chain =
        "#...."
        ".#..."
        "..#.."
        "...#."
        "....#";
    CHECK(without_floaters(chain, 5) == chain);
    for (const char* whole : {"....", "++++", "#..+", "####"})
        CHECK(without_floaters(whole, 2) == whole);
    // What is faint alone is no piece.
    CHECK(without_floaters("##..+++..", 3) == "##..+++..");
}

TEST_CASE("A view in one piece has the same bits without floaters", "[realtime]") {
    const Model model = tiny_model(3);
    const Camera camera = model_camera(model, 0.2, 0.0, 0.0);
    for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
        std::vector<std::vector<double>> images;
        for (const bool remove : {false, true}) {
            FaceRenderer renderer(
                model,
                {.mode = mode, .samples_per_ray = 8, .depth = true, .remove_floaters = remove});
            renderer.show(random_codes(1, 4));
            const View view = renderer.render(camera);
            images.push_back(view.image.to_vector());
            images.push_back(view.depth.to_vector());
        }
        CHECK(images[0] == images[2]);
        CHECK(images[1] == images[3]);
    }
}
