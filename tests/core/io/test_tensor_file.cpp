#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace {

std::string file_of(const std::string& header, std::size_t data_length) {
    const std::uint64_t length = header.size();
    std::string bytes(8, '\0');
    std::memcpy(bytes.data(), &length, 8);
    return bytes + header + std::string(data_length, '\0');
}

std::string entry(const std::string& name, const std::string& dtype, const std::string& shape,
                  const std::string& offsets) {
    return "\"" + name + R"(":{"dtype":")" + dtype + R"(","shape":)" + shape +
           R"(,"data_offsets":)" + offsets + "}";
}

void check_refused(const std::string& bytes, const std::string& reason) {
    const ScratchFolder folder;
    write_file(folder / "bad.safetensors", bytes);
    try {
        static_cast<void>(read_tensor_file(folder / "bad.safetensors"));
        FAIL("read in spite of: " << reason);
    } catch (const FileError& error) {
        CHECK_THAT(error.what(), Contains("bad.safetensors") && Contains(reason));
    }
}

}  // namespace

TEST_CASE("a file of the safetensors package is read with every element type") {
    const TensorFile file = read_tensor_file(std::string(STYMO_SOURCE_DIR) +
                                             "/tests/golden/safetensors/types.safetensors");
    const auto values = [&](const std::string& name) { return file.tensors.at(name).to_vector(); };
    using Values = std::vector<double>;
    CHECK(file.tensors.size() == 15);
    CHECK(file.tensors.at("f32").shape() == Shape{2, 3});
    CHECK(values("f32") == Values{-2.5, -1.5, -0.5, 0.5, 1.5, 2.5});
    CHECK(file.tensors.at("f64").dtype() == DType::float64);
    CHECK(values("f64") == Values{3.141592653589793, -1e300});
    CHECK(values("f16") == Values{0.0, -1.5, 65504.0, 0x1p-24,
                                  std::numeric_limits<double>::infinity(), 0.333251953125});
    CHECK(values("bf16") == Values{1.0, -2.5, 3.140625});
    CHECK(values("i8") == Values{-128, 127});
    CHECK(values("i16") == Values{-32768, 32767});
    CHECK(values("i32") == Values{-2147483648.0, 7});
    CHECK(values("i64") == Values{-1, 0x1p40});
    CHECK(values("u8") == Values{0, 255});
    CHECK(values("u16") == Values{0, 65535});
    CHECK(values("u32") == Values{0, 0x1p32});
    CHECK(values("u64") == Values{0, 0x1p63});
    CHECK(values("bool") == Values{1, 0});
    CHECK(file.tensors.at("scalar").rank() == 0);
    CHECK(file.tensors.at("scalar").item() == 4.25);
    CHECK(file.tensors.at("empty").shape() == Shape{0, 3});
    CHECK(file.metadata ==
          std::map<std::string, std::string>{{"origin", "safetensors"}, {"note", "caf\u00e9"}});
}

TEST_CASE("what is written comes back bit for bit, and the tensors are aligned") {
    const ScratchFolder folder;
    TensorFile contents;
    const std::vector<float> narrow = {1.5F, -0.0F, std::numeric_limits<float>::denorm_min()};
    const std::vector<double> wide = {0.1, std::numeric_limits<double>::max()};
    contents.tensors["a"] = Tensor::from({3, 1}, std::span<const float>(narrow));
    contents.tensors["b"] = Tensor::from({2}, std::span<const double>(wide));
    contents.tensors["none"] = Tensor(Shape{0});
    contents.metadata["config"] = "{\"quotes\": \"and\nlines\"}";
    write_tensor_file(folder / "a.safetensors", contents);

    const TensorFile read = read_tensor_file(folder / "a.safetensors");
    REQUIRE(read.tensors.size() == 3);
    CHECK(read.tensors.at("a").shape() == Shape{3, 1});
    CHECK(std::memcmp(read.tensors.at("a").values<float>().data(), narrow.data(), 12) == 0);
    CHECK(std::memcmp(read.tensors.at("b").values<double>().data(), wide.data(), 16) == 0);
    CHECK(read.metadata == contents.metadata);
    CHECK(folder.file_count() == 1);

    std::uint64_t header_length = 0;
    const std::string bytes = read_file(folder / "a.safetensors");
    std::memcpy(&header_length, bytes.data(), 8);
    CHECK(header_length % 8 == 0);
    CHECK(bytes.size() == 8 + header_length + 12 + 16);
    CHECK(std::memcmp(bytes.data() + 8 + header_length, wide.data(), 16) == 0);
}

TEST_CASE("a file without tensors is a file") {
    const ScratchFolder folder;
    write_tensor_file(folder / "a.safetensors", {});
    CHECK(read_tensor_file(folder / "a.safetensors").tensors.empty());
}

TEST_CASE("elements of 16 bits are rounded to nearest, and those that are too large refused") {
    const ScratchFolder folder;
    TensorFile contents;
    contents.metadata["config"] = "{}";
    contents.tensors["a"] = Tensor::from({4}, std::array{1.0F, 1.0F / 3.0F, -65504.0F, 1e-9F});
    contents.tensors["b"] = Tensor::from({1}, std::array{2.0 + 1.0 / 512.0});
    write_tensor_file(folder / "a.safetensors", contents, StoredElements::float16);
    const TensorFile read = read_tensor_file(folder / "a.safetensors");
    // 11 significant bits: a third is 1365 / 4096, and a tie goes to the even neighbour.
    CHECK(read.tensors.at("a").to_vector() ==
          std::vector<double>{1.0, 1365.0 / 4096.0, -65504.0, 0.0});
    CHECK(read.tensors.at("b").to_vector() == std::vector<double>{2.0 + 1.0 / 512.0});
    CHECK(read.metadata == contents.metadata);

    // A count needs all its digits.
    contents.tensors["count"] = Tensor::scalar(70001.0);
    contents.tensors["b"] = Tensor::from({3}, std::array{1.0, 2.0, 3.0});
    write_tensor_file(folder / "a.safetensors", contents, StoredElements::float16);
    const TensorFile again = read_tensor_file(folder / "a.safetensors");
    CHECK(again.tensors.at("count").item() == 70001.0);
    for (const auto& [name, tensor] : again.tensors)
        CHECK(as_read_from_float16(name, contents.tensors.at(name)).to_vector() ==
              tensor.to_vector());

    contents.tensors["b"] = Tensor::from({1}, std::array{7e4});
    CHECK_THROWS_WITH(
        write_tensor_file(folder / "b.safetensors", contents, StoredElements::float16),
        Catch::Contains("tensor b"));
    CHECK_FALSE(std::filesystem::exists(folder / "b.safetensors"));
}

TEST_CASE("what cannot be written is refused and leaves nothing") {
    const ScratchFolder folder;
    TensorFile contents;
    CHECK_THROWS_AS(write_tensor_file(folder / "none/a.safetensors", contents), FileError);
    contents.tensors["undefined"] = Tensor();
    CHECK_THROWS_AS(write_tensor_file(folder / "a.safetensors", contents), ValueError);
    contents.tensors = {{"\xff", Tensor::scalar(1.0)}};
    CHECK_THROWS_AS(write_tensor_file(folder / "a.safetensors", contents), ValueError);
    CHECK(folder.file_count() == 0);
}

TEST_CASE("every malformed header of a tensor file is refused") {
    const std::string good = file_of("{" + entry("a", "F32", "[2]", "[0,8]") + "}", 8);
    check_refused("", "truncated before the header");
    check_refused(good.substr(0, 7), "truncated before the header");
    check_refused(good.substr(0, 20), "truncated within the header");
    std::string overlong = good;
    overlong[5] = 1;
    check_refused(overlong, "does not begin with the length of a header");
    check_refused(std::string(8, '\xff') + good, "does not begin with the length of a header");
    check_refused(file_of("", 0), "not JSON");
    check_refused(file_of("{\"a\":", 0), "not JSON");
    check_refused(file_of("{\"\xff\":1}", 0), "not JSON");
    check_refused(file_of("[]", 0), "not a JSON object");
    check_refused(file_of("{" + entry("a", "F32", "[1]", "[0,4]") + "," +
                              entry("a", "F32", "[1]", "[4,8]") + "}",
                          8),
                  "\"a\" is given twice");
    check_refused(
        file_of(R"({"a":{"dtype":"F32","dtype":"F32","shape":[1],"data_offsets":[0,4]}})", 4),
        "\"dtype\" is given twice");
    check_refused(file_of(R"({"a":{"dtype":{"x":{}},"shape":[1],"data_offsets":[0,4]}})", 4),
                  "needs exactly");
    check_refused(file_of(R"({"__metadata__":{"a":1}})", 0), "not a map of texts");
    check_refused(file_of(R"({"__metadata__":["a"]})", 0), "not a map of texts");
}

TEST_CASE("every tensor that does not fit its file is refused") {
    const auto refused = [](const std::string& entries, std::size_t data_length,
                            const std::string& reason) {
        check_refused(file_of("{" + entries + "}", data_length), reason);
    };
    refused(R"("a":7)", 0, "needs exactly");
    refused(R"("a":{"dtype":"F32","shape":[0]})", 0, "needs exactly");
    refused(R"("a":{"dtype":1,"shape":[0],"data_offsets":[0,0]})", 0, "needs exactly");
    refused(R"("a":{"dtype":"F32","shape":[0],"data_offsets":[0,0],"more":1})", 0, "needs exactly");
    refused(entry("a", "F32", "[1]", "[0,4,4]"), 4, "needs exactly");
    refused(entry("a", "F33", "[1]", "[0,4]"), 4, "unknown element type \"F33\"");
    refused(entry("a", "F32", "[2]", "[0,8]"), 4, "reaches beyond the file");
    refused(entry("a", "F32", "[1]", "[4,0]"), 4, "reaches beyond the file");
    refused(entry("a", "F32", "[1]", "[18446744073709551612,18446744073709551615]"), 4,
            "reaches beyond the file");
    refused(entry("a", "F32", "[1]", "[-4,0]"), 4, "not a natural number");
    refused(entry("a", "F32", "[-1]", "[0,4]"), 4, "not a natural number");
    refused(entry("a", "F32", "[1.0]", "[0,4]"), 4, "not a natural number");
    refused(entry("a", "F32", "[18446744073709551616]", "[0,4]"), 4, "not a natural number");
    refused(entry("a", "F32", "[3]", "[0,8]"), 8, "needs 12 bytes by its extents but has 8");
    refused(entry("a", "F32", "[4611686018427387905]", "[0,4]"), 4, "overflow");
    refused(entry("a", "F32", "[4294967296,4294967296]", "[0,0]"), 0, "overflow");
    refused(entry("a", "U8", "[9223372036854775808]", "[0,0]"), 0, "overflow");
    refused(entry("a", "F32", "[1,1,1,1,1,1,1]", "[0,4]"), 4, "more than 6 axes");
    refused(entry("a", "F32", "[2]", "[0,8]") + "," + entry("b", "F32", "[2]", "[4,12]"), 12,
            "overlaps");
    refused(entry("a", "F32", "[1]", "[0,4]") + "," + entry("b", "F32", "[1]", "[0,4]"), 4,
            "overlaps");
    refused(entry("a", "F32", "[1]", "[0,4]") + "," + entry("b", "F32", "[1]", "[8,12]"), 12,
            "a hole before tensor \"b\"");
    refused(entry("a", "F32", "[1]", "[4,8]"), 8, "a hole before tensor \"a\"");
    refused(entry("a", "F32", "[1]", "[0,4]"), 9, "5 bytes at the end belong to no tensor");
}
