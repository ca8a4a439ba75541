#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/parallel.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"

namespace {

using stymo::ScratchFolder;

const stymo::MorphableHead& head() {
    return stymo::builtin_head();
}

void write(const std::filesystem::path& folder, std::uint64_t seed, std::int64_t count = 3) {
    stymo::write_synthetic_faces(head(), {count, 48, {}}, stymo::Rng(seed), folder);
}

[[nodiscard]] std::vector<nlohmann::json> records(const std::filesystem::path& folder) {
    std::ifstream file(folder / "faces.jsonl");
    std::vector<nlohmann::json> result;
    for (std::string line; std::getline(file, line);) result.push_back(nlohmann::json::parse(line));
    return result;
}

}  // namespace

TEST_CASE("The same seed writes the same bytes on any number of threads, another seed others") {
    const ScratchFolder folder;
    stymo::set_thread_count(1);
    write(folder / "a", 7);
    stymo::set_thread_count(2);
    write(folder / "b", 7);
    stymo::set_thread_count(0);
    write(folder / "c", 8);
    for (const char* name : {"faces.jsonl", "camera.json", "images/00000.png", "images/00002.png",
                             "masks/00001.png"}) {
        CHECK(stymo::read_file(folder / "a" / name) == stymo::read_file(folder / "b" / name));
    }
    for (const char* name : {"faces.jsonl", "images/00000.png"}) {
        CHECK(stymo::read_file(folder / "a" / name) != stymo::read_file(folder / "c" / name));
    }
}

TEST_CASE("A greater count only adds faces") {
    const ScratchFolder folder;
    write(folder / "a", 7, 2);
    write(folder / "b", 7, 4);
    CHECK(stymo::read_file(folder / "b/faces.jsonl")
              .starts_with(stymo::read_file(folder / "a/faces.jsonl")));
    CHECK(stymo::read_file(folder / "a/images/00001.png") ==
          stymo::read_file(folder / "b/images/00001.png"));
}

TEST_CASE("The mask is exactly what is not black") {
    const ScratchFolder folder;
    write(folder / "a", 1);
    for (const char* name : {"00000.png", "00001.png", "00002.png"}) {
        const stymo::Tensor image = stymo::read_image(folder / "a/images" / name);
        const stymo::Tensor mask = stymo::read_mask(folder / "a/masks" / name);
        REQUIRE(image.shape() == stymo::Shape{48, 48, 3});
        REQUIRE(mask.shape() == stymo::Shape{48, 48, 1});
        double covered = 0.0;
        const auto colors = image.values<float>();
        for (std::size_t pixel = 0; pixel < 48 * 48; ++pixel) {
            const bool black = colors[3 * pixel] == 0.0F && colors[3 * pixel + 1] == 0.0F &&
                               colors[3 * pixel + 2] == 0.0F;
            CHECK(mask.values<float>()[pixel] == (black ? 0.0F : 1.0F));
            covered += static_cast<double>(mask.values<float>()[pixel]) / (48.0 * 48.0);
        }
        CHECK(covered > 0.25);
        CHECK(covered < 0.8);
    }
}

TEST_CASE("Poses and codes in faces.jsonl reproject the landmarks that stand beside them") {
    const ScratchFolder folder;
    write(folder / "a", 5, 6);
    const auto camera_file = nlohmann::json::parse(stymo::read_file(folder / "a/camera.json"));
    const double focal = camera_file.at("focal");
    CHECK(focal == 2.03);
    const auto lines = records(folder / "a");
    REQUIRE(lines.size() == 6);
    for (const auto& line : lines) {
        const std::vector<float> identity = line.at("code").at("id");
        const std::vector<float> expression = line.at("code").at("expr");
        CHECK(line.at("code").at("tex").size() == 100);
        CHECK(line.at("code").at("light").size() == 27);
        const double yaw = line.at("pose").at("yaw_deg").get<double>() * std::numbers::pi / 180.0;
        const double pitch =
            line.at("pose").at("pitch_deg").get<double>() * std::numbers::pi / 180.0;
        const double roll = line.at("pose").at("roll_deg").get<double>() * std::numbers::pi / 180.0;
        CHECK(std::abs(yaw) <= 35.0 * std::numbers::pi / 180.0);
        CHECK(std::abs(pitch) <= 15.0 * std::numbers::pi / 180.0);
        CHECK(std::abs(roll) <= 5.0 * std::numbers::pi / 180.0);
        const std::vector<double> center = line.at("pose").at("t");
        // R = Rz Ry Rx written out; the camera's axes are R's columns, the last two turned round.
        const double cy = std::cos(yaw), sy = std::sin(yaw), cp = std::cos(pitch),
                     sp = std::sin(pitch), cr = std::cos(roll), sr = std::sin(roll);
        const double rotation[3][3] = {{cr * cy, cr * sy * sp - sr * cp, cr * sy * cp + sr * sp},
                                       {sr * cy, sr * sy * sp + cr * cp, sr * sy * cp - cr * sp},
                                       {-sy, cy * sp, cy * cp}};
        const stymo::Tensor vertices = stymo::head_vertices(head(), identity, expression);
        REQUIRE(line.at("landmarks").size() == 68);
        for (std::size_t k = 0; k < 68; ++k) {
            double local[3] = {0.0, 0.0, 0.0};
            for (std::size_t axis = 0; axis < 3; ++axis) {
                for (std::size_t j = 0; j < 3; ++j) {
                    local[axis] +=
                        rotation[j][axis] *
                        (static_cast<double>(
                             vertices.values<
                                 float>()[3 * static_cast<std::size_t>(head().landmarks[k]) + j]) -
                         center[j]);
                }
            }
            const std::vector<double> pixel = line.at("landmarks").at(k);
            CHECK(pixel[0] == Approx(48.0 * (0.5 + focal * local[0] / -local[2])).margin(1e-6));
            CHECK(pixel[1] == Approx(48.0 * (0.5 - focal * local[1] / -local[2])).margin(1e-6));
            CHECK(pixel[0] > 0.0);
            CHECK(pixel[0] < 48.0);
        }
    }
}

TEST_CASE("One-sided expressions are never negative, and different heads differ") {
    const auto first = stymo::sample_synthetic_face(head(), stymo::Rng(3).split(std::uint64_t{0}));
    const auto second = stymo::sample_synthetic_face(head(), stymo::Rng(3).split(std::uint64_t{1}));
    CHECK(first.identity != second.identity);
    CHECK(first.light != second.light);
    for (std::size_t k = 0; k < first.expression.size(); ++k) {
        if (head().one_sided[k]) CHECK(std::min(first.expression[k], second.expression[k]) >= 0.0F);
    }
    for (const float value : first.identity) CHECK(std::abs(value) <= 2.5F);
}

TEST_CASE("Images of another set are not mixed with the new ones") {
    const ScratchFolder folder;
    write(folder / "a", 1, 3);
    CHECK_THROWS_AS(write(folder / "a", 1, 2), stymo::FileError);
    CHECK(records(folder / "a").size() == 3);
    CHECK_NOTHROW(write(folder / "a", 2, 3));
    CHECK_THROWS_AS(write(folder / "a", 1, 0), stymo::ValueError);
}

TEST_CASE("A folder that cannot be made is named") {
    const ScratchFolder folder;
    stymo::write_file(folder / "file", "x");
    CHECK_THROWS_WITH(write(folder / "file", 1), Catch::Contains("file"));
}
