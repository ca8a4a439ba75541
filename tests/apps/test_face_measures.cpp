// The names of the viewer's sliders: what is measured on a face, and what a direction is called.
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "apps/view/face_measures.h"
#include "render/camera.h"
#include "render/morphable/head_source.h"

using namespace stymo;

namespace face_measure_tests {

constexpr std::int64_t side = 256;

struct Picture {
    Tensor image = Tensor::full({side, side, 3}, 0.5);
    Tensor mask = Tensor::full({side, side, 1}, 1.0);
    FacePoints points;

    /// Changes each pixel and its channels by its place, from 0 to 1 across and down.
    void paint(const std::function<float(double x, double y, std::size_t channel)>& factor) {
        const auto values = image.mutable_values<float>();
        for (std::size_t i = 0; i < values.size(); ++i)
            values[i] *= factor(static_cast<double>(i / 3 % side) / side,
                                static_cast<double>(i / 3 / side) / side, i % 3);
    }
};

/// The landmarks of the built-in head on an even picture.
Picture plain_face() {
    const MorphableHead head = morphable_head_from({});
    const Camera camera = camera_from_pose({}, {});
    const auto vertices = head.mean.values<float>();
    Picture picture;
    for (std::size_t k = 0; k < picture.points.size(); ++k) {
        const auto at = 3 * static_cast<std::size_t>(head.landmarks[k]);
        picture.points[k] =
            side * project(camera, {vertices[at], vertices[at + 1], vertices[at + 2]}).head<2>();
    }
    return picture;
}

std::vector<double> change_by(const std::function<void(Picture&)>& change) {
    Picture picture = plain_face();
    const auto before = face_measures(picture.image, picture.mask, picture.points);
    change(picture);
    auto after = face_measures(picture.image, picture.mask, picture.points);
    for (std::size_t m = 0; m < after.size(); ++m) after[m] -= before[m];
    return after;
}

}  // namespace face_measure_tests

using namespace face_measure_tests;

TEST_CASE("a change of a face is called by what it is", "[view]") {
    struct Row {
        const char* more;
        std::size_t group;
        std::function<void(Picture&)> change;
    };
    const auto move = [](std::vector<std::size_t> which, double x, double y) {
        return [=](Picture& picture) {
            for (const std::size_t k : which) picture.points[k] += Eigen::Vector2d(x, y);
        };
    };
    const std::vector<Row> rows{
        {"wide face", 0,
         [](Picture& picture) {
             const double middle = picture.points[30].x();
             for (std::size_t k = 0; k < 17; ++k)
                 picture.points[k].x() += 0.2 * (picture.points[k].x() - middle);
         }},
        {"smile", 1, move({48, 54}, 0.0, -5.0)},
        {"mouth open", 1, move({61, 62, 63}, 0.0, -6.0)},
        {"brows down", 1, move({17, 18, 19, 20, 21, 22, 23, 24, 25, 26}, 0.0, 5.0)},
        {"from left", 3,
         [](Picture& picture) {
             picture.paint([](double x, double, std::size_t) { return x < 0.5 ? 1.4F : 0.7F; });
         }},
        {"from below", 3,
         [](Picture& picture) {
             picture.paint([](double, double y, std::size_t) { return y > 0.6 ? 1.4F : 0.7F; });
         }},
        {"dark", 2,
         [](Picture& picture) { picture.paint([](double, double, std::size_t) { return 0.5F; }); }},
        {"cool", 2,
         [](Picture& picture) {
             picture.paint([](double, double, std::size_t k) { return k == 2 ? 1.5F : 1.0F; });
         }},
    };
    std::vector<std::vector<double>> changes;
    std::vector<std::size_t> groups;
    for (const Row& row : rows) {
        changes.push_back(change_by(row.change));
        groups.push_back(row.group);
    }
    const auto names = names_of_changes(changes, groups);
    for (std::size_t i = 0; i < rows.size(); ++i) CHECK(names[i].more == rows[i].more);
}

TEST_CASE("the largest change has the first choice of names, each once in a group", "[view]") {
    const auto& all = measure_names();
    std::vector<std::vector<double>> changes(4, std::vector<double>(all.size(), 0.0));
    changes[0][0] = 3.0;
    changes[0][1] = -0.1;
    changes[1][0] = -4.0;
    changes[2][2] = 0.1;
    changes[3][2] = 4.0;
    const auto names = names_of_changes(changes, {0, 0, 0, 1});
    CHECK(names[0].more == all[1].less);  // of its group the second changes the first measure more
    CHECK(names[0].less == all[1].more);
    CHECK(names[1].more == all[0].less);
    CHECK(names[2].more.empty());  // too small a change
    CHECK(names[3].more.empty());  // a chin names no expression
}

TEST_CASE("measures are numbers, whatever the picture", "[view]") {
    Picture picture = plain_face();
    for (auto& point : picture.points) point *= 100.0;  // far outside
    for (const double value :
         face_measures(Tensor::zeros({side, side, 3}), picture.mask, picture.points))
        CHECK(std::isfinite(value));
}
