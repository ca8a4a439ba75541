#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/torch_file.h"

namespace torch_file_tests {

using namespace stymo;
using Catch::Matchers::Contains;
using Values = std::vector<double>;

namespace {

std::string golden(const std::string& name) {
    return std::string(STYMO_SOURCE_DIR) + "/tests/golden/weights/" + name;
}

std::string error_of(const std::filesystem::path& path) {
    try {
        static_cast<void>(read_torch_file(path));
    } catch (const FileError& error) {
        return error.what();
    }
    return "read";
}

/// A file of the older format around the pickle of an object (without its end) and the bytes behind
/// the list of storages.
std::string legacy_file(const std::string& object, const std::string& keys = "]",
                        const std::string& storages = "") {
    const std::string magic("\x80\x02\x8a\x0al\xfc\x9c\x46\xf9 j\xa8P\x19.", 15);
    const std::string version("\x80\x02M\xe9\x03.", 6);
    const std::string machine("\x80\x02}U\x0dlittle_endian\x88s.", 21);
    return magic + version + machine + "\x80\x02" + object + "." + "\x80\x02" + keys + "." +
           storages;
}

std::string error_of_bytes(const std::string& bytes) {
    const ScratchFolder folder;
    write_file(folder / "bad.pth", bytes);
    return error_of(folder / "bad.pth");
}

/// Pickle of a float tensor with the given extents, strides and offset (each below 256) in storage
/// "0".
std::string tensor_pickle(const std::vector<int>& extents, const std::vector<int>& strides,
                          int offset) {
    const auto tuple = [](const std::vector<int>& numbers) {
        std::string text = "(";
        for (const int number : numbers) text += std::string("K") + static_cast<char>(number);
        return text + "t";
    };
    const std::string storage = "(U\x07storagectorch\nFloatStorage\nU\x01\x30U\x03\x63puK\x06NtQ";
    return "ctorch._utils\n_rebuild_tensor\n(" + storage + "K" + static_cast<char>(offset) +
           tuple(extents) + tuple(strides) + "tR";
}

std::string six_floats() {
    const std::vector<float> values{0, 1, 2, 3, 4, 5};
    std::string bytes("\x06\0\0\0\0\0\0\0", 8);
    bytes.append(reinterpret_cast<const char*>(values.data()), 24);
    return bytes;
}

}  // namespace

TEST_CASE("every element type of PyTorch is read from either format") {
    for (const char* name : {"types.pth", "types_legacy.pth"}) {
        INFO(name);
        const TensorFile file = read_torch_file(golden(name));
        const auto values = [&](const std::string& tensor) {
            return file.tensors.at(tensor).to_vector();
        };
        CHECK(file.tensors.size() == 12);
        CHECK(file.tensors.at("f32").shape() == Shape{1, 3});
        CHECK(values("f32") == Values{0.5, -2.0, 1e-3F});
        CHECK(file.tensors.at("f64").dtype() == DType::float64);
        CHECK(values("f64") == Values{3.141592653589793, -1e300});
        CHECK(values("f16") ==
              Values{1.5, -65504.0, 0x1p-24, std::numeric_limits<double>::infinity()});
        CHECK(values("bf16") == Values{1.0, -2.5, 3.140625});
        CHECK(values("i8") == Values{-128, 127});
        CHECK(values("i16") == Values{-32768, 7});
        CHECK(values("i32") == Values{-2147483648.0, 7});
        CHECK(values("i64") == Values{-1, 0x1p40});
        CHECK(values("u8") == Values{0, 255});
        CHECK(values("bool") == Values{1, 0});
        CHECK(file.tensors.at("scalar").rank() == 0);
        CHECK(values("scalar") == Values{4.25});
        CHECK(file.tensors.at("empty").shape() == Shape{0, 3});
    }
}

TEST_CASE(
    "views are read by their strides, nested containers give dotted names, and whatever is no "
    "tensor is passed over") {
    for (const char* name :
         {"views.pth", "views_legacy.pth", "views_protocol4.pth", "views_legacy_protocol4.pth"}) {
        INFO(name);
        const TensorFile file = read_torch_file(golden(name));
        const auto values = [&](const std::string& tensor) {
            return file.tensors.at(tensor).to_vector();
        };
        CHECK(file.tensors.size() == 9);
        CHECK(file.tensors.at("state_dict.whole").shape() == Shape{2, 3, 4});
        CHECK(values("state_dict.whole")[23] == 23);
        CHECK(file.tensors.at("state_dict.transposed").shape() == Shape{6, 4});
        CHECK(values("state_dict.transposed")[1] == 6);
        CHECK(values("state_dict.transposed")[4] == 1);
        CHECK(values("state_dict.part") == Values{6, 8, 10, 12, 14, 16});
        CHECK(values("state_dict.tied") == values("state_dict.part"));
        CHECK(values("state_dict.repeated") == Values(6, 7.0));
        CHECK(values("state_dict.parameter") == Values{3, 4});
        CHECK(values("optimizer.state.0.moment") == Values{0.25});
        CHECK(values("list.0") == Values{1});
        CHECK(values("list.1.0") == Values{2});
    }
}

TEST_CASE("numbers of NumPy and a trainer's options beside the tensors are passed over") {
    for (const char* name : {"numpy_scalar.pth", "trainer.pth", "trainer_legacy.pth"}) {
        INFO(name);
        const TensorFile file = read_torch_file(golden(name));
        CHECK(file.tensors.size() == 1);
        CHECK(file.tensors.at("weight").to_vector() == Values{1});
    }
}

TEST_CASE(
    "a checkpoint that names anything beyond tensors and containers is refused by that name and "
    "does nothing") {
    const std::vector<std::pair<std::string, std::string>> cases = {
        {"numpy_array.pth", "multiarray._reconstruct"},
        {"system.pth", "posix.system"},
        {"system_legacy.pth", "posix.system"},
        {"eval.pth", "builtins.eval"},
        {"module.pth", "torch.nn.modules.linear.Linear"},
    };
    for (const auto& [name, culprit] : cases) {
        const std::string error = error_of(golden(name));
        CHECK_THAT(error, Contains(name + ": refuses to load \"") && Contains(culprit) &&
                              Contains("\": not a tensor or container"));
    }
    CHECK_FALSE(std::filesystem::exists("executed"));
    CHECK_THAT(error_of_bytes(legacy_file("cos\nsystem\n(U\x02lstR")), Contains("\"os.system\""));
    // A chain of getattr, names that the pickle puts together, objects made without a call.
    CHECK_THAT(error_of_bytes(legacy_file("cbuiltins\ngetattr\n(cos\n__dict__\nU\x06systemtR")),
               Contains("\"builtins.getattr\""));
    CHECK_THAT(error_of_bytes(legacy_file("ctorch\nSize\n0U\x02os\x8c\x06system\x93(U\x02lstR")),
               Contains("\"os.system\""));
    CHECK_THAT(error_of_bytes(legacy_file("U\x02osq\x01\x30h\x01\x8c\x05popen\x93)\x81")),
               Contains("\"os.popen\""));
    CHECK_THAT(error_of_bytes(legacy_file("ctorch\n_utils.os.system\n(U\x02lstR")),
               Contains("\"torch._utils.os.system\""));
    CHECK_THAT(error_of_bytes(legacy_file("c__builtin__\neval\n(U\x01\x31tR")),
               Contains("\"__builtin__.eval\""));
    CHECK_THAT(error_of_bytes(legacy_file("(U\x02lsios\nsystem\n")),
               Contains("not a readable pickle (code 105"));
}

TEST_CASE("files that are no checkpoints are refused") {
    CHECK_THAT(error_of(golden("plain.pkl")), Contains("plain.pkl: not a readable PyTorch file"));
    CHECK_THAT(error_of(golden("small.onnx")), Contains("small.onnx: not a readable PyTorch file"));
    CHECK_THAT(error_of(golden("none.pth")), Contains("none.pth: cannot be read"));
    CHECK_THAT(error_of_bytes(""), Contains("zero bytes"));
    CHECK_THAT(error_of_bytes("PK\x03\x04"), Contains("bad.pth: not a readable PyTorch file"));
    CHECK_THAT(error_of_bytes(legacy_file("}")), Contains("it holds no tensors"));
}

TEST_CASE("a tensor must lie within its storage") {
    const auto file = [](const std::string& tensor) {
        return legacy_file("}U\x01w" + tensor + "s", "]U\x01\x30\x61", six_floats());
    };
    const ScratchFolder folder;
    write_file(folder / "good.pth", file(tensor_pickle({2, 2}, {3, 1}, 1)));
    CHECK(read_torch_file(folder / "good.pth").tensors.at("w").to_vector() == Values{1, 2, 4, 5});
    CHECK_THAT(error_of_bytes(file(tensor_pickle({2, 2}, {3, 1}, 2))),
               Contains("reaches beyond storage 0"));
    CHECK_THAT(error_of_bytes(file(tensor_pickle({7}, {1}, 0))),
               Contains("reaches beyond storage 0"));
    CHECK_THAT(error_of_bytes(file(tensor_pickle({2, 2}, {1}, 0))), Contains("no proper extent"));
    CHECK_THAT(error_of_bytes(file(tensor_pickle({1, 1, 1, 1, 1, 1, 1}, {1, 1, 1, 1, 1, 1, 1}, 0))),
               Contains("more than 6 axes"));
    CHECK_THAT(error_of_bytes(file(tensor_pickle({255, 255, 255}, {0, 0, 0}, 0))),
               Contains("too many times over"));
    CHECK_THAT(
        error_of_bytes(file(tensor_pickle({255, 255, 255, 255, 255, 255}, {0, 0, 0, 0, 0, 0}, 0))),
        Contains("too many times over"));
}

TEST_CASE("pickles that hold themselves, or the same things over and over, come to an end") {
    CHECK_THAT(error_of_bytes(legacy_file("}q\x01U\x01\x61h\x01s")),
               Contains("too many times over"));
    CHECK_THAT(error_of_bytes(legacy_file("]q\x01h\x01\x61")), Contains("too many times over"));
    const std::string padding = "U\xff" + std::string(255, ' ') + "0";
    CHECK_THAT(error_of_bytes(legacy_file(padding + "}q\x01U" + std::string(1, '\0') + "h\x01s")),
               Contains("nested too deeply"));
    std::string doubling = "]q\x01";
    for (char k = 2; k < 42; ++k)
        doubling += std::string("h") + char(k - 1) + "h" + char(k - 1) + "\x86q" + k;
    CHECK_THAT(error_of_bytes(legacy_file(doubling)), Contains("too many times over"));
}

TEST_CASE("malformed pickles are refused") {
    for (const std::string object :
         {"a", "s", "t", "R", "h\x05", "K\x01K\x02\x86\x52", "}U\x01\x61u", "(K\x01\x64", "\xff",
          "N}b", "K\x01\x61", "X\xff\xff\xff\xff", "c", "cos",
          "\x8e\xff\xff\xff\xff\xff\xff\xff\x7f", "\x80\x07", "Q", "(0"})
        CHECK_THAT(error_of_bytes(legacy_file(object)), Contains("bad.pth: not a readable"));
}

TEST_CASE(
    "a file that is cut anywhere, or in which a byte is wrong, is read or refused but never "
    "worse") {
    const ScratchFolder folder;
    int number = 0;
    const auto survives = [&](const std::string& bytes) {
        // A new name each time: a file that is overwritten waits for the disk.
        const std::filesystem::path path = folder / (std::to_string(number++) + ".pth");
        std::ofstream(path, std::ios::binary) << bytes;
        const std::string error = error_of(path);
        std::filesystem::remove(path);
        return error == "read" ||
               (error.find(".pth: ") != std::string::npos && error.find('\n') == std::string::npos);
    };
    for (const char* name : {"views.pth", "views_legacy.pth"}) {
        const std::string bytes = read_file(golden(name));
        bool all = true;
        for (std::size_t length = 0; length < bytes.size(); ++length) {
            all = all && survives(bytes.substr(0, length));
            std::string changed = bytes;
            changed[length] =
                static_cast<char>(changed[length] ^ static_cast<char>(1U << (length % 8)));
            all = all && survives(changed);
        }
        CHECK(all);
    }
}

}  // namespace torch_file_tests
