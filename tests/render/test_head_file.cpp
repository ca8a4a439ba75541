#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "core/error.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "render/morphable/head_source.h"
#include "shared_data.h"

namespace {

using stymo::Tensor;

/// Seventy vertices: the 68 landmarks along a spiral around a sphere, eyes above the mouth, and two
/// more.
[[nodiscard]] stymo::TensorFile small_head() {
    constexpr std::int64_t count = 70;
    std::vector<float> points;
    for (int k = 0; k < count; ++k) {
        const bool mouth = k >= 48 && k < 68;
        points.insert(points.end(),
                      {static_cast<float>(3.0 * std::cos(k)), mouth ? -4.0F : 3.0F, 8.0F});
    }
    std::vector<float> landmarks(68);
    for (std::size_t k = 0; k < 68; ++k) landmarks[k] = static_cast<float>(k);
    stymo::TensorFile file;
    file.tensors["mean"] = Tensor::from({count, 3}, std::span<const float>(points));
    file.tensors["basis.id"] = Tensor::full({100, count, 3}, 0.5);
    file.tensors["basis.expr"] = Tensor::full({2, count, 3}, 1.0);
    file.tensors["triangles"] =
        Tensor::from({1, 3}, std::span<const float>(std::vector<float>{0, 1, 36}));
    file.tensors["landmarks68"] = Tensor::from({68}, std::span<const float>(landmarks));
    return file;
}

[[nodiscard]] std::string refusal(const stymo::TensorFile& contents) {
    const stymo::ScratchFolder folder;
    stymo::write_tensor_file(folder / "head.safetensors", contents);
    try {
        static_cast<void>(stymo::read_morphable_head(folder / "head.safetensors"));
    } catch (const stymo::FileError& error) {
        return error.what();
    }
    return "";
}

}  // namespace

TEST_CASE(
    "A head from a file is scaled to the built-in head's eyes and mouth and padded to the code "
    "sizes") {
    const stymo::ScratchFolder folder;
    stymo::write_tensor_file(folder / "head.safetensors", small_head());
    const stymo::MorphableHead head = stymo::read_morphable_head(folder / "head.safetensors");
    CHECK(head.identity.shape() == stymo::Shape{100, 70, 3});
    CHECK(head.expression.shape() == stymo::Shape{79, 70, 3});
    CHECK(head.albedo.shape() == stymo::Shape{100, 70, 3});
    // 7 cm between eyes and mouth become 0.57 units.
    CHECK(head.mean.values<float>()[3 * 36 + 1] == Approx(0.05));
    CHECK(head.mean.values<float>()[3 * 48 + 1] == Approx(-0.52));
    CHECK(head.identity.values<float>()[0] == Approx(0.5 * 0.57 / 7.0));
    CHECK(head.expression.values<float>()[2 * 70 * 3] == 0.0F);
    CHECK(head.one_sided[1]);
    CHECK_FALSE(head.one_sided[2]);
}

TEST_CASE("A file that is no morphable head is refused with the tensor's name") {
    for (const char* name : {"mean", "basis.id", "basis.expr", "triangles", "landmarks68"}) {
        stymo::TensorFile file = small_head();
        file.tensors.erase(name);
        CHECK_THAT(refusal(file), Catch::Contains(std::string("\"") + name + "\"") &&
                                      Catch::Contains("head.safetensors"));
        file.tensors[name] = Tensor::full({7}, 1.0);
        CHECK_THAT(refusal(file), Catch::Contains(std::string("\"") + name + "\""));
    }
    for (const float bad : {70.0F, -1.0F}) {
        stymo::TensorFile file = small_head();
        file.tensors["triangles"].mutable_values<float>()[1] = bad;
        CHECK_THAT(refusal(file), Catch::Contains("triangles"));
    }
    stymo::TensorFile upside_down = small_head();
    for (float& value : upside_down.tensors["mean"].mutable_values<float>()) value = -value;
    CHECK_THAT(refusal(upside_down), Catch::Contains("landmarks"));
}

TEST_CASE("The scanned head of the shared data fits the frame") {
    const auto path = stymo::shared_data("data/ict_face.safetensors");
    if (!path) return;
    const stymo::MorphableHead head = stymo::read_morphable_head(*path);
    CHECK(head.vertex_count() == 26719);
    const auto points = head.mean.values<float>();
    for (const auto& triangle : head.triangles) {
        for (const std::int32_t vertex : triangle) {
            const auto* point = &points[3 * static_cast<std::size_t>(vertex)];
            REQUIRE(std::abs(point[0]) < 1.1F);
            REQUIRE(std::abs(point[1]) < 1.2F);
            REQUIRE(std::abs(point[2]) < 1.3F);
        }
    }
    CHECK(points[3 * static_cast<std::size_t>(head.landmarks[30]) + 2] > 0.9F);
}
