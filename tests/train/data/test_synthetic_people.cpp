#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "core/angle.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/parallel.h"
#include "support/textured_squares.h"
#include "train/data/face_records.h"
#include "train/data/synthetic_people.h"

namespace synthetic_people_tests {

[[nodiscard]] stymo::TexturedHeads squares(const std::filesystem::path& folder) {
    stymo::write_tensor_file(folder / "heads.safetensors", stymo::textured_squares());
    return stymo::read_textured_heads(folder / "heads.safetensors");
}

}  // namespace synthetic_people_tests

TEST_CASE("The same seed writes the same people, and more people only add to them") {
    const stymo::ScratchFolder folder;
    const auto heads = synthetic_people_tests::squares(folder.path());
    const auto write = [&](const char* name, std::int64_t people) {
        stymo::write_synthetic_people(heads, {people, 3, 32, "a_", {}}, stymo::Rng(4),
                                      folder / name);
    };
    stymo::set_thread_count(1);
    write("a", 2);
    stymo::set_thread_count(2);
    write("b", 3);
    stymo::set_thread_count(0);
    CHECK(stymo::read_file(folder / "b/faces.jsonl")
              .starts_with(stymo::read_file(folder / "a/faces.jsonl")));
    for (const char* name : {"images/a_00000_0.png", "images/a_00001_2.png", "masks/a_00001_1.png"})
        CHECK(stymo::read_file(folder / "a" / name) == stymo::read_file(folder / "b" / name));
    CHECK_THROWS_AS(write("a", 1), stymo::FileError);  // the folder has other images
    CHECK_THROWS_AS(write("c", 0), stymo::ValueError);
    CHECK_THROWS_AS(
        stymo::write_synthetic_people(heads, {1, 1, 32, "../a", {}}, stymo::Rng(4), folder / "c"),
        stymo::ValueError);
}

TEST_CASE("Views of a person share it, have their own light, and have the whole head") {
    const stymo::ScratchFolder folder;
    const auto heads = synthetic_people_tests::squares(folder.path());
    stymo::write_synthetic_people(heads, {4, 6, 48, "a_", {}}, stymo::Rng(9), folder / "a");
    const stymo::FaceRecords records(folder / "a/faces.jsonl");
    CHECK(records.size() == 24);
    for (int person = 0; person < 4; ++person) {
        std::set<std::string> lights;
        for (int view = 0; view < 6; ++view) {
            const std::string id = "a_0000" + std::to_string(person) + "_" + std::to_string(view);
            const stymo::FaceRecord record = records.read(id);
            CHECK(record.origin.person == "a_0000" + std::to_string(person));
            lights.insert(record.origin.series);
            CHECK(record.origin.source == "synthetic");
            CHECK(record.code.empty());
            const double yaw = std::abs(stymo::degrees_from_radians(record.pose->yaw));
            CHECK(yaw <= (view % 3 == 0 ? 35.0 : 80.0));
            // The first landmark is the upper left corner of the rectangle.
            const auto camera = stymo::camera_from_pose(*record.pose, {});
            const Eigen::Vector3d corner = stymo::project(camera, {-0.57, 0.05, 0.68});
            CHECK(record.landmarks[0].x() == Approx(48.0 * corner.x()).margin(1e-3));
            CHECK(record.landmarks[0].y() == Approx(48.0 * corner.y()).margin(1e-3));
            const stymo::Tensor mask = stymo::read_mask(folder / ("a/masks/" + id + ".png"));
            for (std::size_t k = 0; k < 48; ++k) {
                CHECK(mask.values<float>()[k] == 0.0F);
                CHECK(mask.values<float>()[48 * k] == 0.0F);
                CHECK(mask.values<float>()[48 * k + 47] == 0.0F);
            }
        }
        CHECK(lights.size() == 6);
    }
}

TEST_CASE("People are mixes of two or three heads, some with hair; expressions are one-sided") {
    const stymo::ScratchFolder folder;
    const auto heads = synthetic_people_tests::squares(folder.path());
    std::map<std::int64_t, int> hair;
    for (std::uint64_t person = 0; person < 40; ++person) {
        const auto view = stymo::sample_synthetic_view(heads, stymo::Rng(1).split(person), 1, {});
        CHECK(view.person.weights[0] + view.person.weights[1] == Approx(1.0));
        CHECK(view.expression[0] >= 0.0F);
        CHECK(view.expression[0] <= 1.0F);
        ++hair[view.person.hair];
        const auto other = stymo::sample_synthetic_view(heads, stymo::Rng(1).split(person), 2, {});
        CHECK(other.person.weights == view.person.weights);
        CHECK(other.light != view.light);
    }
    CHECK(hair[-1] > 10);
    CHECK(hair[0] > 5);
}
