#include "core/io/onnx_file.h"

#include <array>
#include <bit>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "core/error.h"
#include "core/io/element_type.h"
#include "core/io/file.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// One field of an encoded protocol-buffer message: its number in the schema, and a number (floats
/// as their bits) or bytes (texts, messages, packed lists).
struct Field {
    std::uint64_t tag = 0;
    std::uint64_t number = 0;
    std::string_view bytes{};
    bool has_bytes = false;
};

/// Walks through an ONNX model (onnx.proto of onnx/onnx, ONNX 1.x) and reads the parts that the
/// weights need.
class OnnxReader {
public:
    explicit OnnxReader(const fs::path& path) : path_(path) {}

    OnnxGraph read_model(std::string_view model) {
        bool has_graph = false;
        each_field(model, [&](const Field& field) {
            if (field.tag == 7 && field.has_bytes) {
                has_graph = true;
                read_graph(field.bytes);
            }
        });
        if (!has_graph) refuse("it has no graph");
        return std::move(graph_);
    }

private:
    struct Attribute {
        std::string name{};
        std::optional<double> number{};
        std::vector<std::int64_t> integers{};
        std::optional<std::string_view> tensor{};
    };

    template <class... Parts>
    [[noreturn]] void refuse(const Parts&... parts) const {
        fail<FileError>(path_.string(), ": not a readable ONNX model (", parts..., ")");
    }

    std::string_view take(std::string_view& rest, std::uint64_t length) const {
        if (length > rest.size()) refuse("truncated");
        const std::string_view taken = rest.substr(0, length);
        rest.remove_prefix(length);
        return taken;
    }

    std::uint64_t take_varint(std::string_view& rest) const {
        std::uint64_t value = 0;
        for (unsigned shift = 0; shift < 64; shift += 7) {
            const auto byte = static_cast<unsigned char>(take(rest, 1).front());
            value |= std::uint64_t{byte & 0x7FU} << shift;
            if (byte < 0x80U) return value;
        }
        refuse("malformed");
    }

    std::uint64_t take_fixed(std::string_view& rest, std::size_t length) const {
        std::uint64_t value = 0;
        std::memcpy(&value, take(rest, length).data(), length);
        return value;
    }

    template <class Visitor>
    void each_field(std::string_view message, const Visitor& visit) const {
        while (!message.empty()) {
            const std::uint64_t key = take_varint(message);
            Field field{.tag = key >> 3};
            switch (key & 7U) {
                case 0:
                    field.number = take_varint(message);
                    break;
                case 1:
                    field.number = take_fixed(message, 8);
                    break;
                case 2:
                    field.bytes = take(message, take_varint(message));
                    field.has_bytes = true;
                    break;
                case 5:
                    field.number = take_fixed(message, 4);
                    break;
                default:
                    refuse("malformed");
            }
            visit(field);
        }
    }

    /// Appends the values of a repeated integer field, packed or not.
    void append_integers(const Field& field, std::vector<std::int64_t>& integers) const {
        if (!field.has_bytes) {
            integers.push_back(static_cast<std::int64_t>(field.number));
            return;
        }
        for (std::string_view rest = field.bytes; !rest.empty();)
            integers.push_back(static_cast<std::int64_t>(take_varint(rest)));
    }

    /// Appends the values of a repeated field of fixed size, packed or not.
    static void append_fixed(const Field& field, std::size_t size, std::string& bytes) {
        if (field.has_bytes) {
            bytes += field.bytes;
        } else {
            bytes.append(reinterpret_cast<const char*>(&field.number), size);
        }
    }

    void read_graph(std::string_view message) {
        each_field(message, [&](const Field& field) {
            if (!field.has_bytes) return;
            if (field.tag == 1) {
                read_node(field.bytes);
            } else if (field.tag == 5) {
                auto [name, tensor] = read_tensor(field.bytes);
                add_tensor(name, tensor);
            } else if (field.tag == 15) {
                refuse("sparse tensors are not supported");
            }
        });
    }

    void add_tensor(const std::string& name, const Tensor& tensor) {
        if (name.empty()) refuse("a tensor has no name");
        if (!graph_.tensors.emplace(name, tensor).second)
            refuse("two tensors are called \"", name, "\"");
    }

    void read_node(std::string_view message) {
        OnnxNode node;
        std::optional<std::string_view> constant;
        each_field(message, [&](const Field& field) {
            if (!field.has_bytes) return;
            if (field.tag == 1) node.inputs.emplace_back(field.bytes);
            if (field.tag == 2) node.outputs.emplace_back(field.bytes);
            if (field.tag == 3) node.name = field.bytes;
            if (field.tag == 4) node.operation = field.bytes;
            if (field.tag == 5) {
                Attribute attribute = read_attribute(field.bytes);
                if (attribute.number) node.numbers[attribute.name] = *attribute.number;
                if (!attribute.integers.empty())
                    node.integers[attribute.name] = std::move(attribute.integers);
                if (attribute.tensor && attribute.name == "value") constant = attribute.tensor;
            }
        });
        if (node.operation == "Constant" && constant && node.outputs.size() == 1) {
            add_tensor(node.outputs[0], read_tensor(*constant).second);
        } else {
            graph_.nodes.push_back(std::move(node));
        }
    }

    [[nodiscard]] Attribute read_attribute(std::string_view message) const {
        Attribute attribute;
        each_field(message, [&](const Field& field) {
            if (field.tag == 1) attribute.name = field.bytes;
            if (field.tag == 2 && !field.has_bytes)
                attribute.number = std::bit_cast<float>(static_cast<std::uint32_t>(field.number));
            if (field.tag == 3 && !field.has_bytes)
                attribute.number = static_cast<double>(static_cast<std::int64_t>(field.number));
            if (field.tag == 5) attribute.tensor = field.bytes;
            if (field.tag == 8) append_integers(field, attribute.integers);
        });
        return attribute;
    }

    /// A tensor whose extents and bytes have not been compared yet.
    struct StoredTensor {
        std::string name{};
        std::vector<std::int64_t> extents{};
        std::uint64_t type = 0;
        std::string_view raw{};
        std::string fixed{};  ///< float_data and double_data
        std::vector<std::int64_t>
            integers{};  ///< int32_data (also halves), int64_data, uint64_data
        std::string location{};
        bool is_external = false;
    };

    /// TensorProto.DataType
    [[nodiscard]] const ElementType& element_type(const StoredTensor& tensor) const {
        constexpr std::array<std::string_view, 17> names{"",    "F32", "U8", "I8",   "U16", "I16",
                                                         "I32", "I64", "",   "BOOL", "F16", "F64",
                                                         "U32", "U64", "",   "",     "BF16"};
        const ElementType* type =
            tensor.type < names.size() ? find_element_type(names[tensor.type]) : nullptr;
        if (type == nullptr)
            refuse("tensor \"", tensor.name, "\" has the unsupported element type ", tensor.type);
        return *type;
    }

    [[nodiscard]] std::string location_of(std::string_view entry) const {
        std::string key;
        std::string value;
        each_field(entry, [&](const Field& field) {
            if (field.tag == 1) key = field.bytes;
            if (field.tag == 2) value = field.bytes;
        });
        return key == "location" ? value : "";
    }

    [[nodiscard]] StoredTensor stored_tensor(std::string_view message) const {
        StoredTensor tensor;
        each_field(message, [&](const Field& field) {
            switch (field.tag) {
                case 1:
                    append_integers(field, tensor.extents);
                    break;
                case 2:
                    tensor.type = field.number;
                    break;
                case 4:
                    append_fixed(field, sizeof(float), tensor.fixed);
                    break;
                case 5:
                case 7:
                case 11:
                    append_integers(field, tensor.integers);
                    break;
                case 8:
                    tensor.name = field.bytes;
                    break;
                case 9:
                    tensor.raw = field.bytes;
                    break;
                case 10:
                    append_fixed(field, sizeof(double), tensor.fixed);
                    break;
                case 13:
                    tensor.location += location_of(field.bytes);
                    break;
                case 14:
                    tensor.is_external = field.number == 1;
                    break;
                default:
                    break;
            }
        });
        return tensor;
    }

    [[nodiscard]] std::pair<std::string, Tensor> read_tensor(std::string_view message) const {
        const StoredTensor stored = stored_tensor(message);
        if (stored.is_external || !stored.location.empty())
            fail<FileError>(path_.string(), ": tensor \"", stored.name,
                            "\" is kept in another file, \"", stored.location,
                            "\"; save the model with its weights inside");
        const ElementType& type = element_type(stored);
        if (stored.extents.size() > Shape::max_rank)
            refuse("tensor \"", stored.name, "\" has more than ", Shape::max_rank, " axes");
        const auto count = checked_element_count(stored.extents);
        if (!count) refuse("tensor \"", stored.name, "\" has no proper extents");
        std::string bytes = stored.fixed;
        for (const std::int64_t value : stored.integers)
            bytes.append(reinterpret_cast<const char*>(&value), type.bytes);
        const std::string_view data = stored.raw.empty() ? std::string_view(bytes) : stored.raw;
        const std::uint64_t needed = static_cast<std::uint64_t>(*count) * type.bytes;
        if (data.size() != needed)
            refuse("tensor \"", stored.name, "\" needs ", needed, " bytes by its extents but has ",
                   data.size());
        return {stored.name, type.read(Shape(stored.extents), data.data())};
    }

    const fs::path& path_;
    OnnxGraph graph_;
};

}  // namespace

OnnxGraph read_onnx_file(const fs::path& path) {
    const std::string bytes = read_file(path);
    return OnnxReader(path).read_model(bytes);
}

}  // namespace stymo
