#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/onnx_file.h"
#include "core/io/scratch_folder.h"

namespace onnx_file_tests {

using namespace stymo;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Values = std::vector<double>;
using Names = std::vector<std::string>;

namespace {

std::string golden(const std::string& name) {
    return std::string(STYMO_SOURCE_DIR) + "/tests/golden/weights/" + name;
}

std::string error_of(const std::filesystem::path& path) {
    try {
        static_cast<void>(read_onnx_file(path));
    } catch (const FileError& error) {
        return error.what();
    }
    return "read";
}

}  // namespace

TEST_CASE("the tensors of an ONNX model are read however they are stored") {
    const OnnxGraph graph = read_onnx_file(golden("small.onnx"));
    const auto values = [&](const std::string& tensor) {
        return graph.tensors.at(tensor).to_vector();
    };
    CHECK(graph.tensors.size() == 17);
    CHECK(graph.tensors.at("conv.weight").shape() == Shape{2, 2, 3, 3});
    CHECK(values("conv.weight")[35] == 34.5);
    CHECK(values("f16_raw") == Values{1.5, -65504.0, 0x1p-24});
    CHECK(values("i64_raw") == Values{-1, 0x1p40});
    CHECK(graph.tensors.at("f64_scalar").rank() == 0);
    CHECK(graph.tensors.at("f64_scalar").dtype() == DType::float64);
    CHECK(values("f64_scalar") == Values{4.25});
    CHECK(graph.tensors.at("empty").shape() == Shape{0, 3});
    CHECK(graph.tensors.at("f32").shape() == Shape{2, 1});
    CHECK(values("f32") == Values{0.25, -3.0});
    CHECK(values("f64") == Values{3.141592653589793});
    CHECK(values("f16") == Values{1.5, -0.5});
    CHECK(values("bf16") == Values{1.0, -2.5});
    CHECK(values("i8") == Values{-128, 127});
    CHECK(values("u8") == Values{0, 255});
    CHECK(values("i16") == Values{-32768});
    CHECK(values("i32") == Values{-2147483648.0, 7});
    CHECK(values("i64") == Values{-5, 0x1p40});
    CHECK(values("u64") == Values{0x1p63});
    CHECK(values("bool") == Values{1, 0});
    CHECK(values("shape") == Values{1, -1});
}

TEST_CASE(
    "the operations of an ONNX model come in their order with inputs, outputs and attributes") {
    const std::vector<OnnxNode> nodes = read_onnx_file(golden("small.onnx")).nodes;
    REQUIRE(nodes.size() == 4);
    CHECK(nodes[0].operation == "Conv");
    CHECK(nodes[0].name == "first");
    CHECK(nodes[0].inputs == Names{"image", "conv.weight"});
    CHECK(nodes[0].outputs == Names{"a"});
    CHECK(nodes[0].numbers == std::map<std::string, double>{{"group", 1.0}});
    CHECK(nodes[0].integers == std::map<std::string, std::vector<std::int64_t>>{
                                   {"kernel_shape", {3, 3}}, {"strides", {2, 2}}});
    CHECK(nodes[1].numbers.at("alpha") == 0.25);
    CHECK(nodes[2].integers.at("perm") == std::vector<std::int64_t>{0, 2, 3, 1});
    CHECK(nodes[3].numbers.at("allowzero") == -1.0);
}

TEST_CASE(
    "an ONNX model whose weights lie elsewhere, or that holds texts, is refused by the tensor's "
    "name") {
    CHECK_THAT(
        error_of(golden("external.onnx")),
        Contains(
            "external.onnx: tensor \"conv.weight\" is kept in another file, \"external.bin\""));
    CHECK_THAT(error_of(golden("string.onnx")),
               Contains("tensor \"words\" has the unsupported element type 8"));
}

TEST_CASE("weights in a file beside the model are read, as far as that file goes") {
    const ScratchFolder folder;
    write_file(folder / "external.onnx", read_file(golden("external.onnx")));
    std::vector<float> values(36);
    std::iota(values.begin(), values.end(), 0.5F);
    const std::string bytes(reinterpret_cast<const char*>(values.data()), 144);
    write_file(folder / "external.bin", bytes);
    const Tensor weight = read_onnx_file(folder / "external.onnx").tensors.at("conv.weight");
    CHECK(weight.shape() == Shape{2, 2, 3, 3});
    CHECK(weight.to_vector() == Values(values.begin(), values.end()));
    write_file(folder / "external.bin", bytes.substr(0, 100));
    CHECK_THAT(error_of(folder / "external.onnx"), Contains("reaches beyond external.bin"));
}

TEST_CASE("a plain ONNX model has the same weights as float32, and the axes of reductions inside") {
    const ScratchFolder folder;
    const auto plain = [&](const std::filesystem::path& path) {
        write_file(folder / "plain.onnx", read_plain_onnx(path).bytes);
        return read_onnx_file(folder / "plain.onnx");
    };
    const OnnxGraph graph = plain(golden("small.onnx"));
    const OnnxGraph expected = read_onnx_file(golden("small.onnx"));
    CHECK(read_plain_onnx(golden("small.onnx")).input == std::vector<std::int64_t>{1, 2, 8, 8});
    CHECK(graph.nodes.size() == 4);
    REQUIRE(graph.tensors.size() == expected.tensors.size());
    for (const auto& [name, tensor] : expected.tensors) {
        INFO(name);
        CHECK(graph.tensors.at(name).dtype() == DType::float32);
        CHECK(graph.tensors.at(name).to_vector() == tensor.to(DType::float32).to_vector());
    }
    const OnnxGraph reduced = plain(golden("../onnx/face_parser_opset18.onnx"));
    const auto reduction = std::ranges::find(reduced.nodes, "ReduceMax", &OnnxNode::operation);
    REQUIRE(reduction != reduced.nodes.end());
    CHECK(reduction->inputs.size() == 1);
    CHECK(reduction->integers.at("axes") == std::vector<std::int64_t>{2, 3});
    const OnnxGraph kept = plain(golden("../onnx/face_parser_noop.onnx"));
    REQUIRE(kept.nodes.size() > 1);
    CHECK(kept.nodes[1].operation == "Identity");
    CHECK(kept.nodes[1].outputs == Names{"mean"});
    const auto with_axes = std::ranges::find(kept.nodes, "ReduceMax", &OnnxNode::operation);
    REQUIRE(with_axes != kept.nodes.end());
    CHECK(with_axes->numbers.empty());
    CHECK(with_axes->integers.at("axes") == std::vector<std::int64_t>{2, 3});
    std::string squares = read_file(golden("../onnx/face_parser_noop.onnx"));
    squares.replace(squares.find("ReduceSum"), 9, "ReduceLog");
    write_file(folder / "log.onnx", squares);
    CHECK_THROWS_WITH(read_plain_onnx(folder / "log.onnx"),
                      Contains("ReduceLog reduces nothing without axes"));
    const OnnxGraph sums = plain(golden("../onnx/face_parser_broadcast.onnx"));
    std::string operations;
    for (const OnnxNode& node : sums.nodes) operations += node.operation + ' ';
    CHECK_THAT(operations,
               EndsWith("ReduceMean Sub Exp Mul Sub Exp Mul Sub ReduceMax Unsqueeze Unsqueeze Sub "
                        "Exp Mul Sub Exp Mul Sub Exp Exp Reciprocal Mul Clip Clip "));
    CHECK(sums.nodes.back().numbers == std::map<std::string, double>{{"max", 1e9}});
    const OnnxGraph inside = plain(golden("../onnx/face_parser_external.onnx"));
    CHECK(inside.tensors.at("extents").to_vector() == Values{1, 19, 16, 16});
}

TEST_CASE("a tensor of an ONNX model that lies about its type, extents or position is refused") {
    const auto field = [](int tag, const std::string& bytes) {
        return std::string{static_cast<char>(tag << 3 | 2), static_cast<char>(bytes.size())} +
               bytes;
    };
    const auto number = [](int tag, std::uint64_t value) {
        std::string bytes(1, static_cast<char>(tag << 3));
        for (; value > 127; value >>= 7) bytes += static_cast<char>(128 | (value & 127));
        return bytes + static_cast<char>(value);
    };
    const auto error = [&](const std::string& description) {
        const ScratchFolder folder;
        write_file(folder / "bad.onnx",
                   field(7, field(5, description + field(8, "w") + field(9, "12345678"))));
        return error_of(folder / "bad.onnx");
    };
    const std::string f32 = number(2, 1);
    CHECK(error(number(1, 2) + f32) == "read");
    CHECK_THAT(error(number(1, 3) + f32), Contains("needs 12 bytes by its extents but has 8"));
    CHECK_THAT(error(number(1, ~std::uint64_t{0}) + f32), Contains("no proper extents"));
    CHECK_THAT(error(number(1, 1ULL << 62) + number(1, 4) + f32), Contains("no proper extents"));
    CHECK_THAT(error(number(1, 1ULL << 61 | 1) + f32), Contains("bad.onnx"));
    CHECK_THAT(error(number(1, 1ULL << 62 | 2) + f32), Contains("bad.onnx"));
    for (const std::uint64_t type : {0ULL, 8ULL, 14ULL, 17ULL, ~0ULL})
        CHECK_THAT(error(number(1, 2) + number(2, type)), Contains("unsupported element type"));
    CHECK_THAT(error(number(1, 2) + f32 + number(14, 1) +
                     field(13, field(1, "location") + field(2, "../../etc/passwd"))),
               Contains("kept in another file, \"../../etc/passwd\""));
}

TEST_CASE("an ONNX graph that takes what nothing gives, or several inputs, has no plain form") {
    const ScratchFolder folder;
    std::string bytes = read_file(golden("small.onnx"));
    bytes.replace(bytes.find("image"), 5, "imagf");
    write_file(folder / "bad.onnx", bytes);
    CHECK_THROWS_WITH(read_plain_onnx(folder / "bad.onnx"),
                      Contains("Conv takes \"imagf\", which nothing before it gives"));
    CHECK_THROWS_WITH(read_plain_onnx(golden("string.onnx")), Contains("element type 8"));
}

TEST_CASE("what is no ONNX model is refused") {
    const ScratchFolder folder;
    for (const std::string& text : {std::string(), std::string("text"), std::string("\x08\x07", 2),
                                    std::string("\x3a\x7f", 2)}) {
        write_file(folder / "bad.onnx", text);
        CHECK_THAT(error_of(folder / "bad.onnx"),
                   Contains("bad.onnx: not a readable ONNX model ("));
    }
}

TEST_CASE(
    "an ONNX model that is cut anywhere, or in which a byte is wrong, is read or refused but never "
    "worse") {
    const ScratchFolder folder;
    const std::string bytes = read_file(golden("small.onnx"));
    bool all = true;
    int number = 0;
    const auto survives = [&](const std::string& changed) {
        // A new name each time: a file that is overwritten waits for the disk.
        const std::filesystem::path path = folder / (std::to_string(number++) + ".onnx");
        std::ofstream(path, std::ios::binary) << changed;
        const std::string error = error_of(path);
        std::filesystem::remove(path);
        return error == "read" || error.find(".onnx: ") != std::string::npos;
    };
    for (std::size_t length = 0; length < bytes.size(); ++length) {
        all = all && survives(bytes.substr(0, length));
        std::string changed = bytes;
        changed[length] =
            static_cast<char>(static_cast<unsigned char>(changed[length]) ^ (1U << (length % 8)));
        all = all && survives(changed);
    }
    CHECK(all);
}

}  // namespace onnx_file_tests
