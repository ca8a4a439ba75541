#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file.h"
#include "core/io/onnx_file.h"
#include "core/io/onnx_source.h"
#include "core/io/protobuf.h"

namespace stymo {
namespace {

using protobuf::bytes_field;
using protobuf::integer_field;

/// TensorProto.DataType
constexpr std::uint64_t type_float = 1;
constexpr std::array<std::uint64_t, 3> other_floats{10, 11, 16};  // float16, float64, bfloat16

bool is_other_float(std::uint64_t type) {
    return std::ranges::find(other_floats, type) != other_floats.end();
}

/// AttributeProto.AttributeType
constexpr std::int64_t type_number = 1, type_tensor = 4, type_integers = 7;

/// Says that a reduction without axes reduces nothing.
constexpr std::string_view keeping = "noop_with_empty_axes";

/// Operations whose second input was an attribute once.
bool takes_axes(std::string_view operation) {
    return operation.starts_with("Reduce") || operation == "Squeeze" || operation == "Unsqueeze";
}

std::string made_node(std::string_view operation, const std::vector<std::string>& inputs,
                      const std::string& output, std::string_view attributes = {}) {
    std::string result;
    for (const std::string& input : inputs) result += bytes_field(1, input);
    result += bytes_field(2, output) + bytes_field(4, operation);
    return bytes_field(1, result.append(attributes));
}

std::string axes_attribute(const std::vector<std::int64_t>& axes) {
    std::string integers;
    for (const std::int64_t axis : axes) integers += integer_field(8, axis);
    if (integers.empty()) return {};
    return bytes_field(5, bytes_field(1, "axes") + integers + integer_field(20, type_integers));
}

/// Copies a model field by field, and changes what a plain one has otherwise.
class PlainWriter {
public:
    PlainWriter(OnnxSource& source, const OnnxGraph& graph) : source_(source), graph_(graph) {
        for (const auto& [name, tensor] : graph.tensors) known_.insert(name);
        constant_ = known_;
    }

    PlainOnnx model(std::string_view message) {
        std::string bytes = copied(message, [&](const OnnxField& field) {
            return field.tag == 7 ? bytes_field(7, graph(field.bytes)) : std::string(field.whole);
        });
        if (inputs_.size() != 1) source_.refuse(inputs_.size(), " inputs instead of one");
        return {std::move(bytes), inputs_[0]};
    }

private:
    template <class Copy>
    std::string copied(std::string_view message, const Copy& copy) const {
        std::string result;
        source_.each_field(message, [&](const OnnxField& field) {
            result += field.has_bytes ? copy(field) : std::string(field.whole);
        });
        return result;
    }

    std::string graph(std::string_view message) {
        // Inputs follow the operations that take them.
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == 11 && field.has_bytes) read_input(field.bytes);
            if (field.tag == 13 && field.has_bytes) read_rank(field.bytes);
        });
        return copied(message, [&](const OnnxField& field) -> std::string {
            switch (field.tag) {
                case 1: return node(field.bytes);
                case 5: return bytes_field(5, tensor(field.bytes));
                case 11:
                case 12:
                case 13:
                    return bytes_field(static_cast<std::uint32_t>(field.tag),
                                       with_type(field.bytes, {2, 1}));
                default: return std::string(field.whole);
            }
        });
    }

    void read_rank(std::string_view message) {
        each_within(message, {2, 1, 2}, [&](std::string_view shape) {
            std::int64_t rank = 0;
            source_.each_field(shape, [&](const OnnxField& field) { rank += field.tag == 1; });
            source_.each_field(message, [&](const OnnxField& field) {
                if (field.tag == 1) ranks_[std::string(field.bytes)] = rank;
            });
        });
    }

    /// Initialisers may be listed among the inputs.
    void read_input(std::string_view message) {
        std::vector<std::int64_t> extents;
        each_within(message, {2, 1, 2, 1}, [&](std::string_view dimension) {
            extents.push_back(0);
            source_.each_field(dimension, [&](const OnnxField& field) {
                if (field.tag == 1) extents.back() = static_cast<std::int64_t>(field.number);
            });
        });
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == 1 && known_.insert(std::string(field.bytes)).second)
                inputs_.push_back(extents);
        });
    }

    /// Calls visit(message) for the messages at the end of a path of tags.
    template <class Visit>
    void each_within(std::string_view message, std::vector<std::uint64_t> path,
                     const Visit& visit) const {
        if (path.empty()) return visit(message);
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == path.front() && field.has_bytes)
                each_within(field.bytes, {path.begin() + 1, path.end()}, visit);
        });
    }

    /// A ValueInfoProto; `path` are the tags of the messages around the element type.
    std::string with_type(std::string_view message, std::vector<std::uint64_t> path) const {
        std::string result;
        bool has_shape = false;
        source_.each_field(message, [&](const OnnxField& field) {
            has_shape = has_shape || field.tag == 2;
            if (!path.empty() && field.tag == path.front() && field.has_bytes) {
                result += bytes_field(static_cast<std::uint32_t>(field.tag),
                                      with_type(field.bytes, {path.begin() + 1, path.end()}));
            } else if (path.empty() && field.tag == 1 && is_other_float(field.number)) {
                result += integer_field(1, type_float);
            } else {
                result += field.whole;
            }
        });
        // OpenCV refuses a value of unknown shape, and looks at those of inputs only.
        return path.empty() && !has_shape ? result + bytes_field(2, "") : result;
    }

    std::string tensor(std::string_view message) {
        const OnnxStoredTensor stored = source_.stored_tensor(message);
        if (!stored.is_external && !is_other_float(stored.type)) return std::string(message);
        std::string result;
        for (const std::int64_t extent : stored.extents) result += integer_field(1, extent);
        result += bytes_field(8, stored.name);
        if (!is_other_float(stored.type))
            return result + integer_field(2, static_cast<std::int64_t>(stored.type)) +
                   bytes_field(9, source_.external_bytes(stored));
        const Tensor narrow = source_.tensor_of(stored).to(DType::float32);
        const auto values = narrow.values<float>();
        return result + integer_field(2, type_float) +
               bytes_field(9, {reinterpret_cast<const char*>(values.data()), values.size_bytes()});
    }

    struct Node {
        std::string operation;
        std::vector<std::string> inputs, outputs;
        std::vector<std::int64_t> axes;  ///< the attribute
        bool may_keep = false;
    };

    Node parsed_node(std::string_view message) const {
        Node node;
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == 5 && field.has_bytes) {
                const auto [name, number] = named(field.bytes);
                node.may_keep = node.may_keep || (name == keeping && number != 0);
                if (name == "axes")
                    source_.each_field(field.bytes, [&](const OnnxField& part) {
                        if (part.tag == 8) source_.append_integers(part, node.axes);
                    });
            }
            if (field.tag == 1) node.inputs.push_back(original(std::string(field.bytes)));
            if (field.tag == 2) node.outputs.emplace_back(field.bytes);
            if (field.tag == 4) node.operation = field.bytes;
        });
        while (!node.inputs.empty() && node.inputs.back().empty()) node.inputs.pop_back();
        return node;
    }

    std::string node(std::string_view message) {
        Node node = parsed_node(message);
        const auto& [operation, inputs, outputs, listed_axes, may_keep] = node;
        require_inputs(operation, inputs);
        known_.insert(outputs.begin(), outputs.end());
        note_kind(node);
        // PyTorch names equal tensors so, and OpenCV knows no Identity of a constant.
        if (operation == "Identity" && inputs.size() == 1 && outputs.size() == 1 &&
            graph_.tensors.contains(inputs[0])) {
            originals_[outputs[0]] = inputs[0];
            return {};
        }
        const bool moves_axes = takes_axes(operation) && inputs.size() == 2;
        if (moves_axes && !inputs[1].empty()) node.axes = constant_integers(operation, inputs[1]);
        if (may_keep && node.axes.empty()) {
            // Others would still square or take logarithms.
            constexpr std::string_view plain =
                "ReduceMax ReduceMean ReduceMin ReduceProd ReduceSum ";
            if (inputs.empty() || outputs.size() != 1 ||
                plain.find(operation + ' ') == std::string_view::npos)
                source_.refuse(operation, " reduces nothing without axes, which is not supported");
            return made_node("Identity", {inputs[0]}, outputs[0]);
        }
        if (outputs.size() == 1)
            if (std::string others = in_other_words(node); !others.empty()) return others;
        std::string result;
        for (std::size_t i = 0; i < (moves_axes ? 1 : inputs.size()); ++i)
            result += bytes_field(1, inputs[i]);
        result += copied(message, [&](const OnnxField& field) {
            if (field.tag == 1) return std::string();
            // With axes it says nothing, and OpenCV does not know it.
            if (field.tag == 5 && named(field.bytes).first == keeping) return std::string();
            return field.tag == 5 ? bytes_field(5, attribute(operation, field.bytes))
                                  : std::string(field.whole);
        });
        return bytes_field(1, result + (moves_axes ? axes_attribute(node.axes) : std::string()));
    }

    /// Notes whether the outputs are constant (as extents are), and whether they may have to be
    /// broadcast.
    void note_kind(const Node& node) {
        const auto all_in = [&](const std::set<std::string>& names) {
            return std::ranges::all_of(node.inputs, [&](const std::string& name) {
                return name.empty() || names.contains(name) || constant_.contains(name);
            });
        };
        const std::string& operation = node.operation;
        if (operation == "Shape" || all_in(constant_))
            constant_.insert(node.outputs.begin(), node.outputs.end());
        else if (operation.starts_with("Reduce") || operation.starts_with("Global") ||
                 operation == "Unsqueeze" || all_in(narrow_))
            narrow_.insert(node.outputs.begin(), node.outputs.end());
    }

    /// The operation as others that OpenCV 4.6 computes rightly; empty if it can stay.
    std::string in_other_words(const Node& node) const {
        const auto& [operation, inputs, outputs, axes, may_keep] = node;
        const std::string& output = outputs[0];
        const auto varies = [&](std::size_t input) { return !constant_.contains(inputs[input]); };
        // Of other extents than the divisor, the dividend would be divided by.
        if (operation == "Div" && inputs.size() == 2 && varies(1))
            return made_node("Reciprocal", {inputs[1]}, output + "/inverse") +
                   made_node("Mul", {inputs[0], output + "/inverse"}, output);
        if ((operation == "Add" || operation == "Sub") && inputs.size() == 2 && varies(0) &&
            varies(1) && (narrow_.contains(inputs[0]) || narrow_.contains(inputs[1])))
            return sum_of_equal_extents(node);
        if (operation == "Unsqueeze" && !inputs.empty() && varies(0))
            return axis_by_axis(inputs[0], axes, output);
        if (operation == "Clip" && inputs.size() > 1) return clip_of_numbers(inputs, output);
        if (operation == "Max" && inputs.size() == 2) return clip_of_numbers(inputs, output);
        if (operation == "Min" && inputs.size() == 2)
            return clip_of_numbers({inputs[0], "", inputs[1]}, output);
        return {};
    }

    /// Broadcasts each operand by a product with ones, because a product may broadcast either.
    static std::string sum_of_equal_extents(const Node& node) {
        std::string result;
        std::vector<std::string> operands;
        for (const std::size_t i : {0U, 1U}) {
            const std::string name = node.outputs[0] + (i == 0 ? "/first" : "/second");
            const std::string& other = node.inputs[1 - i];
            result += made_node("Sub", {other, other}, name + "/zeros") +
                      made_node("Exp", {name + "/zeros"}, name + "/ones") +
                      made_node("Mul", {node.inputs[i], name + "/ones"}, name);
            operands.push_back(name);
        }
        return result + made_node(node.operation, operands, node.outputs[0]);
    }

    std::string axis_by_axis(const std::string& input, std::vector<std::int64_t> axes,
                             const std::string& output) const {
        for (std::int64_t& axis : axes) {
            if (axis >= 0) continue;
            const auto rank = ranks_.find(input);
            if (rank == ranks_.end())
                source_.refuse("Unsqueeze counts axes from the end of \"", input,
                               "\", whose shape is not given");
            axis += rank->second + std::ssize(axes);
        }
        std::ranges::sort(axes);
        std::string result, from = input;
        for (std::size_t i = 0; i < axes.size(); ++i) {
            const std::string to = i + 1 == axes.size() ? output : output + "/" + std::to_string(i);
            result += made_node("Unsqueeze", {from}, to, axes_attribute({axes[i]}));
            from = to;
        }
        return result;
    }

    std::string clip_of_numbers(const std::vector<std::string>& inputs,
                                const std::string& output) const {
        std::string bounds;
        for (std::size_t i = 1; i < inputs.size(); ++i) {
            if (inputs[i].empty()) continue;
            const auto bound = graph_.tensors.find(inputs[i]);
            if (bound == graph_.tensors.end() || bound->second.size() != 1) return {};
            const auto number = static_cast<float>(bound->second.to_vector()[0]);
            const std::string bytes(reinterpret_cast<const char*>(&number), sizeof number);
            bounds += bytes_field(5, bytes_field(1, i == 1 ? "min" : "max") +
                                         protobuf::key(2, protobuf::Wire::fixed32) + bytes +
                                         integer_field(20, type_number));
        }
        return made_node("Clip", {inputs[0]}, output, bounds);
    }

    /// The name of an attribute, and its integer.
    [[nodiscard]] std::pair<std::string_view, std::uint64_t> named(std::string_view message) const {
        std::pair<std::string_view, std::uint64_t> result;
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == 1) result.first = field.bytes;
            if (field.tag == 3) result.second = field.number;
        });
        return result;
    }

    [[nodiscard]] std::string original(const std::string& name) const {
        const auto found = originals_.find(name);
        return found == originals_.end() ? name : found->second;
    }

    void require_inputs(const std::string& operation, const std::vector<std::string>& inputs) {
        for (const std::string& input : inputs)
            if (!input.empty() && !known_.contains(input))
                source_.refuse(operation, " takes \"", input, "\", which nothing before it gives");
    }

    [[nodiscard]] std::vector<std::int64_t> constant_integers(const std::string& operation,
                                                              const std::string& name) const {
        if (const auto found = graph_.tensors.find(name); found != graph_.tensors.end()) {
            constexpr double most = 64.0;
            std::vector<std::int64_t> axes;
            for (const double value : found->second.to_vector()) {
                if (!(std::abs(value) <= most)) source_.refuse(operation, " has improper axes");
                axes.push_back(static_cast<std::int64_t>(value));
            }
            return axes;
        }
        source_.refuse(operation, " computes its axes, and only constant ones are supported");
    }

    std::string attribute(std::string_view operation, std::string_view message) {
        const std::string_view name = named(message).first;
        if (operation == "Constant" && OnnxSource::is_listed_constant(name))
            return bytes_field(1, "value") + bytes_field(5, source_.listed_constant(message)) +
                   integer_field(20, type_tensor);
        std::string result;
        source_.each_field(message, [&](const OnnxField& field) {
            if (field.tag == 5 && field.has_bytes) {
                result += bytes_field(5, tensor(field.bytes));
            } else if (field.tag == 3 && operation == "Cast" && name == "to" &&
                       is_other_float(field.number)) {
                result += integer_field(3, type_float);
            } else {
                result += field.whole;
            }
        });
        return result;
    }

    OnnxSource& source_;
    const OnnxGraph& graph_;
    std::set<std::string> known_;
    std::set<std::string> constant_;
    std::set<std::string> narrow_;
    std::map<std::string, std::int64_t> ranks_;
    std::map<std::string, std::string> originals_;  ///< constants by their other names
    std::vector<std::vector<std::int64_t>> inputs_;
};

}  // namespace

PlainOnnx read_plain_onnx(const std::filesystem::path& path) {
    const std::string bytes = read_file(path);
    OnnxSource source(path);
    const OnnxGraph graph = read_onnx_graph(source, bytes);
    return PlainWriter(source, graph).model(bytes);
}

}  // namespace stymo
