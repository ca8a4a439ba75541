#include <array>
#include <catch2/catch.hpp>
#include <filesystem>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "fit/photo/face_parser.h"
#include "fit/photo/onnx_network.h"
#include "render/parsing_classes.h"

using namespace stymo;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

fs::path golden(const std::string& name) {
    return fs::path(STYMO_SOURCE_DIR) / "tests/golden/onnx" / name;
}

/// Rows of squares, the n-th in the n-th colour of make_face_parsers.py; five to a row.
Tensor image_of_parts(std::int64_t square) {
    Tensor image({5 * square, 5 * square, 3});
    const auto values = image.mutable_values<float>();
    for (std::int64_t i = 0; i < 25 * square * square; ++i) {
        const std::int64_t n =
            (i / (5 * square) / square * 5 + i % (5 * square) / square) % parsing_class_count;
        const std::array<std::int64_t, 3> color = {n / 9, n / 3 % 3, n % 3};
        for (std::size_t c = 0; c < 3; ++c)
            values[static_cast<std::size_t>(i) * 3 + c] = static_cast<float>(color[c]) / 2.0F;
    }
    return image;
}

float at_square(const Tensor& classes, std::int64_t n) {
    const std::int64_t square = classes.shape(0) / 5;
    const std::int64_t row = n / 5 * square + square / 2;
    const std::int64_t column = n % 5 * square + square / 2;
    return classes.values<float>()[static_cast<std::size_t>(row * classes.shape(1) + column)];
}

void check_parts(FaceParser parser) {
    for (const std::int64_t square : {48, 103}) {
        const Tensor classes = parser.parse(image_of_parts(square));
        REQUIRE(classes.shape() == Shape{5 * square, 5 * square, 1});
        for (int n = 0; n < parsing_class_count; ++n)
            CHECK(at_square(classes, n) == static_cast<float>(n));
    }
}

}  // namespace

TEST_CASE("a parser in CelebAMask-HQ's order is recognised and its classes come back") {
    FaceParser parser(golden("face_parser_celebamask.onnx"));
    CHECK(parser.kind() == FaceParserKind::celebamask);
    check_parts(std::move(parser));
}

TEST_CASE("a parser of face-parsing.PyTorch is recognised and its classes are renamed") {
    FaceParser parser(golden("face_parser_bisenet.onnx"));
    CHECK(parser.kind() == FaceParserKind::face_parsing_pytorch);
    check_parts(std::move(parser));
}

TEST_CASE(
    "a parser runs with its weights in a second file, in float16, with opset 18's reductions and "
    "with what has to be broadcast") {
    for (const char* name : {"external", "float16", "opset18", "noop", "broadcast"}) {
        INFO(name);
        check_parts(FaceParser(golden("face_parser_" + std::string(name) + ".onnx")));
    }
}

TEST_CASE("a parser whose second file is missing is refused by its name") {
    const ScratchFolder folder;
    fs::copy(golden("face_parser_external.onnx"), folder / "parser.onnx");
    CHECK_THROWS_WITH(FaceParser(folder / "parser.onnx"),
                      Contains("kept in another file, \"face_parser_external.onnx.data\"; put "
                               "that file beside the model"));
}

TEST_CASE("what is no face parser is refused in one line") {
    CHECK_THROWS_WITH(FaceParser(golden("missing.onnx")), Contains("missing.onnx"));
    CHECK_THROWS_WITH(FaceParser(golden("face_parser_18_classes.onnx")), Contains("19 classes"));
    CHECK_THROWS_WITH(
        FaceParser(golden("face_parser_celebamask.onnx"), FaceParserKind::face_parsing_pytorch),
        Contains("not a face parser") && Contains("512 x 512"));
    CHECK_THROWS_WITH(FaceParser(fs::path(STYMO_SOURCE_DIR) / "README.md"),
                      Contains("not an ONNX network"));
}

TEST_CASE(
    "on a head alone every pixel of the mask is a part of a head, and every other background") {
    FaceParser parser(golden("face_parser_celebamask.onnx"));
    const Tensor image = image_of_parts(48);
    const Tensor plain = parser.parse(image);
    Tensor mask = Tensor::full({240, 240, 1}, 0.6);
    for (std::size_t i = 0; i < 240 * 120; ++i) mask.mutable_values<float>()[i] = 0.4F;
    const Tensor classes = parser.parse_head(image, mask);
    for (std::size_t i = 0; i < 240 * 240; ++i) {
        const float part = classes.values<float>()[i];
        const float unmasked = plain.values<float>()[i];
        if (i < 240 * 120) {
            REQUIRE(part == 0.0F);
        } else if (is_head_class(static_cast<int>(unmasked))) {
            REQUIRE(part == unmasked);
        } else {
            REQUIRE(is_head_class(static_cast<int>(part)));
        }
    }
    CHECK_THROWS_WITH(parser.parse_head(image, Tensor::zeros({24, 24, 1})),
                      Contains("does not belong"));
}
