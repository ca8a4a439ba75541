#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <sstream>

#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "render/morphable/head_source.h"
#include "support/error_message.h"

namespace {

using stymo::Tensor;

using Files = std::map<std::string, std::string>;

constexpr int vertex_count = 70;

[[nodiscard]] std::array<double, 3> neutral_point(int k) {
    const bool mouth = k >= 48 && k < 68;
    return {3.0 * std::cos(k), mouth ? -4.0 : 3.0, 8.0 + 0.01 * k};
}

/// A mesh of 70 vertices, all moved by `shift`, with texture coordinates and a quad as in the
/// published files.
[[nodiscard]] std::string obj(const std::array<double, 3>& shift) {
    std::ostringstream text;
    text << "mtllib ICTFaceModelMaterial.mtl\n";
    for (int k = 0; k < vertex_count; ++k) {
        const auto point = neutral_point(k);
        text << "v " << point[0] + shift[0] << ' ' << point[1] + shift[1] << ' '
             << point[2] + shift[2] << "\r\n";
    }
    text << "vt 0.5 0.5\nusemtl M\nf 1/1 2/1 37/1 4/1\nf -1/1/1 -2//1 3\n";
    return text.str();
}

[[nodiscard]] Files small_model() {
    std::string landmarks;
    for (int k = 0; k < 68; ++k) landmarks += (k > 0 ? "," : "") + std::to_string(k);
    return {{"vertex_indices.json",
             R"({"expressions": ["jawOpen", "browDown_L"], "idx_to_landmark_verts": [)" +
                 landmarks + "]}"},
            {"generic_neutral_mesh.obj", obj({})},
            {"identity000.obj", obj({1.0, 0.0, 0.0})},
            {"identity001.obj", obj({0.0, 2.0, 0.0})},
            {"jawOpen.obj", obj({0.0, -1.0, 0.0})},
            {"browDown_L.obj", obj({0.0, 0.0, 0.5})}};
}

void write(const std::filesystem::path& folder, const Files& files) {
    for (const auto& [name, text] : files) stymo::write_file(folder / name, text);
}

[[nodiscard]] std::string refusal(const Files& files) {
    const stymo::ScratchFolder folder;
    write(folder.path(), files);
    return stymo::test::error_message(
        [&] { static_cast<void>(stymo::morphable_head_from(folder.path())); });
}

}  // namespace

TEST_CASE("A folder of ICT-FaceKit is read as its conversion to safetensors is") {
    const stymo::ScratchFolder folder;
    write(folder.path(), small_model());
    const stymo::MorphableHead head = stymo::morphable_head_from(folder.path());

    stymo::TensorFile file;
    std::vector<float> mean;
    std::vector<float> landmarks;
    Tensor identity = Tensor::zeros({100, vertex_count, 3});
    Tensor expression = Tensor::zeros({2, vertex_count, 3});
    for (int k = 0; k < vertex_count; ++k) {
        for (const double value : neutral_point(k)) mean.push_back(static_cast<float>(value));
        const auto i = static_cast<std::size_t>(3 * k);
        identity.mutable_values<float>()[i] = 1.0F;
        identity.mutable_values<float>()[3 * vertex_count + i + 1] = 2.0F;
        expression.mutable_values<float>()[i + 1] = -1.0F;
        expression.mutable_values<float>()[3 * vertex_count + i + 2] = 0.5F;
        if (k < 68) landmarks.push_back(static_cast<float>(k));
    }
    file.tensors["mean"] = Tensor::from({vertex_count, 3}, std::span<const float>(mean));
    file.tensors["basis.id"] = identity;
    file.tensors["basis.expr"] = expression;
    file.tensors["triangles"] = Tensor::from(
        {3, 3}, std::span<const float>(std::vector<float>{0, 1, 36, 0, 36, 3, 69, 68, 2}));
    file.tensors["landmarks68"] = Tensor::from({68}, std::span<const float>(landmarks));
    stymo::write_tensor_file(folder / "head.safetensors", file);
    const stymo::MorphableHead converted = stymo::morphable_head_from(folder / "head.safetensors");

    CHECK(head.triangles == converted.triangles);
    CHECK(head.landmarks == converted.landmarks);
    CHECK(head.one_sided == converted.one_sided);
    for (const auto tensor :
         {&stymo::MorphableHead::mean, &stymo::MorphableHead::identity,
          &stymo::MorphableHead::expression, &stymo::MorphableHead::mean_albedo}) {
        const auto a = (head.*tensor).values<float>();
        const auto b = (converted.*tensor).values<float>();
        REQUIRE(a.size() == b.size());
        // The text of the test has six digits.
        for (std::size_t i = 0; i < a.size(); ++i) REQUIRE(a[i] == Approx(b[i]).margin(2e-5));
    }
}

TEST_CASE("A folder that is no morphable head is refused with the file's name") {
    for (const char* name :
         {"vertex_indices.json", "generic_neutral_mesh.obj", "identity000.obj", "jawOpen.obj"}) {
        Files files = small_model();
        files.erase(name);
        CHECK_THAT(refusal(files), Catch::Contains(name));
        files[name] = "v 1 2 x\n";
        CHECK_THAT(refusal(files), Catch::Contains(name));
    }
    Files fewer = small_model();
    fewer["identity001.obj"] = "v 1 2 3\n";
    CHECK_THAT(refusal(fewer), Catch::Contains("identity001.obj") && Catch::Contains("70"));
    Files outside = small_model();
    outside["generic_neutral_mesh.obj"] += "f 1 2 71\n";
    CHECK_THAT(refusal(outside), Catch::Contains("vertex 71"));
    for (const char* corner : {"-71", "0", "9223372036854775807", "-9223372036854775808",
                               "18446744073709551616", "1.5", "//"}) {
        Files wrong = small_model();
        wrong["generic_neutral_mesh.obj"] += std::string("f 1 2 ") + corner + "\n";
        CHECK_THAT(refusal(wrong), Catch::Contains("generic_neutral_mesh.obj: line "));
    }
    Files elsewhere = small_model();
    elsewhere["vertex_indices.json"] = R"({"expressions": ["../jawOpen"]})";
    CHECK_THAT(refusal(elsewhere), Catch::Contains("no name of a file in this folder"));
    elsewhere["vertex_indices.json"] = std::string(1000000, '[');
    CHECK_THAT(refusal(elsewhere), Catch::Contains("vertex_indices.json: nested deeper"));
    Files landmarks = small_model();
    landmarks["vertex_indices.json"] =
        R"({"expressions": ["jawOpen"], "idx_to_landmark_verts": [1, 2]})";
    CHECK_THAT(refusal(landmarks), Catch::Contains("68"));
}

TEST_CASE("A path to a head that is not there is one clear line") {
    CHECK_THAT(stymo::test::error_message(
                   [] { static_cast<void>(stymo::morphable_head_from("/no/such/head")); }),
               Catch::Contains("/no/such/head"));
}
