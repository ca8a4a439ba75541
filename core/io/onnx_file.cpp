#include "core/io/onnx_file.h"

#include <bit>
#include <optional>
#include <string_view>
#include <utility>

#include "core/io/file.h"
#include "core/io/onnx_source.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

/// Walks through an ONNX model and reads the parts that the weights need.
class OnnxReader {
public:
    explicit OnnxReader(OnnxSource& source) : source_(source) {}

    OnnxGraph read_model(std::string_view model) {
        bool has_graph = false;
        source_.each_field(model, [&](const OnnxField& field) {
            if (field.tag == 7 && field.has_bytes) {
                has_graph = true;
                read_graph(field.bytes);
            }
        });
        if (!has_graph) source_.refuse("it has no graph");
        return std::move(graph_);
    }

private:
    struct Attribute {
        std::string name{};
        std::optional<double> number{};
        std::vector<std::int64_t> integers{};
        std::optional<std::string_view> tensor{};
    };

    void read_graph(std::string_view message) {
        source_.each_field(message, [&](const OnnxField& field) {
            if (!field.has_bytes) return;
            if (field.tag == 1) {
                read_node(field.bytes);
            } else if (field.tag == 5) {
                auto [name, tensor] = read_tensor(field.bytes);
                add_tensor(name, tensor);
            } else if (field.tag == 15) {
                source_.refuse("sparse tensors are not supported");
            }
        });
    }

    void add_tensor(const std::string& name, const Tensor& tensor) {
        if (name.empty()) source_.refuse("a tensor has no name");
        if (!graph_.tensors.emplace(name, tensor).second)
            source_.refuse("two tensors are called \"", name, "\"");
    }

    void read_node(std::string_view message) {
        OnnxNode node;
        std::optional<std::string_view> constant, listed;
        source_.each_field(message, [&](const OnnxField& field) {
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
                if (OnnxSource::is_listed_constant(attribute.name)) listed = field.bytes;
            }
        });
        const bool is_constant = node.operation == "Constant" && node.outputs.size() == 1;
        if (is_constant && (constant || listed)) {
            const std::string made = constant ? "" : source_.listed_constant(*listed);
            add_tensor(node.outputs[0], read_tensor(constant ? *constant : made).second);
        } else {
            graph_.nodes.push_back(std::move(node));
        }
    }

    [[nodiscard]] Attribute read_attribute(std::string_view message) const {
        Attribute attribute;
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == 1) attribute.name = field.bytes;
            if (field.tag == 2 && !field.has_bytes)
                attribute.number = std::bit_cast<float>(static_cast<std::uint32_t>(field.number));
            if (field.tag == 3 && !field.has_bytes)
                attribute.number = static_cast<double>(static_cast<std::int64_t>(field.number));
            if (field.tag == 5) attribute.tensor = field.bytes;
            if (field.tag == 8) source_.append_integers(field, attribute.integers);
        });
        return attribute;
    }

    [[nodiscard]] std::pair<std::string, Tensor> read_tensor(std::string_view message) {
        const OnnxStoredTensor stored = source_.stored_tensor(message);
        return {stored.name, source_.tensor_of(stored)};
    }

    OnnxSource& source_;
    OnnxGraph graph_;
};

}  // namespace

OnnxGraph read_onnx_file(const fs::path& path) {
    OnnxSource source(path);
    return read_onnx_graph(source, read_file(path));
}

OnnxGraph read_onnx_graph(OnnxSource& source, std::string_view model) {
    return OnnxReader(source).read_model(model);
}

}  // namespace stymo
