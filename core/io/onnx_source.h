#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/io/element_type.h"
#include "core/io/onnx_file.h"

namespace stymo {

/// One field of an encoded protocol-buffer message: its number in the schema, and a number (floats
/// as their bits) or bytes (texts, messages, packed lists).
struct OnnxField {
    std::uint64_t tag = 0;
    std::uint64_t number = 0;
    std::string_view bytes{};
    bool has_bytes = false;
    std::string_view whole{};  ///< the field as it is encoded
};

/// A tensor whose extents and bytes have not been compared yet.
struct OnnxStoredTensor {
    std::string name{};
    std::vector<std::int64_t> extents{};
    std::uint64_t type = 0;  ///< TensorProto.DataType
    std::string_view raw{};
    std::string fixed{};                   ///< float_data and double_data
    std::vector<std::int64_t> integers{};  ///< int32_data (also halves), int64_data, uint64_data
    std::map<std::string, std::string> external{};  ///< location, offset, length
    bool is_external = false;
};

/// The messages of an ONNX model (onnx.proto of onnx/onnx, ONNX 1.x) and the files beside it. For
/// the readers of ONNX only. Everything throws FileError for a model that is truncated or
/// malformed.
class OnnxSource {
public:
    explicit OnnxSource(std::filesystem::path path) : path_(std::move(path)) {}

    template <class... Parts>
    [[noreturn]] void refuse(const Parts&... parts) const {
        fail<FileError>(path_.string(), ": not a readable ONNX model (", parts..., ")");
    }

    template <class Visitor>
    void each_field(std::string_view message, const Visitor& visit) const {
        while (!message.empty()) visit(take_field(message));
    }

    /// Appends the values of a repeated integer field, packed or not.
    void append_integers(const OnnxField& field, std::vector<std::int64_t>& integers) const;
    [[nodiscard]] OnnxStoredTensor stored_tensor(std::string_view message) const;
    [[nodiscard]] static bool is_listed_constant(std::string_view attribute_name) {
        return attribute_name.starts_with("value_int") || attribute_name.starts_with("value_float");
    }
    /// The tensor of the attribute value_int, value_ints, value_float or value_floats of a
    /// Constant.
    [[nodiscard]] std::string listed_constant(std::string_view attribute) const;
    /// The bytes of a tensor that is kept in another file. They live as long as this object. Throws
    /// FileError if the file is not beside the model.
    [[nodiscard]] std::string_view external_bytes(const OnnxStoredTensor& tensor);
    /// Throws FileError if the bytes are not those of the extents.
    [[nodiscard]] Tensor tensor_of(const OnnxStoredTensor& tensor);

private:
    [[nodiscard]] OnnxField take_field(std::string_view& message) const;
    [[nodiscard]] std::string_view take(std::string_view& rest, std::uint64_t length) const;
    [[nodiscard]] std::uint64_t take_varint(std::string_view& rest) const;
    [[nodiscard]] std::uint64_t take_fixed(std::string_view& rest, std::size_t length) const;
    void read_entry(std::string_view entry, std::map<std::string, std::string>& entries) const;
    [[nodiscard]] const ElementType& element_type(const OnnxStoredTensor& tensor) const;

    std::filesystem::path path_;
    struct ExternalFile {
        std::string bytes;
        std::uint64_t taken = 0;
    };
    std::map<std::string, ExternalFile> files_;
};

/// What `read_onnx_file` does with the bytes of a model.
[[nodiscard]] OnnxGraph read_onnx_graph(OnnxSource& source, std::string_view model);

}  // namespace stymo
