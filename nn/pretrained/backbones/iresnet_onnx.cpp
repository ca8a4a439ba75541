#include "nn/pretrained/backbones/iresnet_onnx.h"

#include <algorithm>
#include <sstream>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"
#include "nn/layers/batch_norm.h"
#include "nn/pretrained/backbones/iresnet.h"

namespace stymo {
namespace {

/// Reads the operations one after the other and names their tensors.
class Reader {
public:
    Reader(const OnnxGraph& graph, const std::string& source) : graph_(graph), source_(source) {
        for (const OnnxNode& node : graph.nodes) {
            // Exporters store equal constants once and give the others an alias.
            if (node.operation == "Identity" && !node.inputs.empty() && !node.outputs.empty() &&
                has_tensor(node.inputs[0])) {
                aliases_[node.outputs[0]] = resolved(node.inputs[0]);
            } else if (node.operation != "Constant") {
                nodes_.push_back(&node);
            }
        }
    }

    [[nodiscard]] NamedIresnet network() {
        convolution("conv1", "bn1");
        slope("prelu");
        std::vector<int> blocks;
        while (operation_at(1) == "Conv") block(blocks);
        batch_norm("bn2");
        if (operation_at(0) == "Flatten" || operation_at(0) == "Reshape") ++next_;
        fully_connected("fc");
        batch_norm("features");
        if (next_ != nodes_.size()) refuse("the end");
        return {name_of(blocks), std::move(file_)};
    }

private:
    void block(std::vector<int>& blocks) {
        // Whether the block begins a stage, which decides its name, is known only at its end.
        const std::size_t begin = next_;
        std::size_t end = begin;
        while (end < nodes_.size() && nodes_[end]->operation != "Add") ++end;
        const bool first = std::any_of(nodes_.begin() + static_cast<std::ptrdiff_t>(begin),
                                       nodes_.begin() + static_cast<std::ptrdiff_t>(end),
                                       [&](const OnnxNode* node) { return is_pointwise(*node); });
        if (first || blocks.empty()) blocks.push_back(0);
        const std::string name =
            "layer" + std::to_string(blocks.size()) + "." + std::to_string(blocks.back()++) + ".";
        batch_norm(name + "bn1");
        convolution(name + "conv1", name + "bn2");
        slope(name + "prelu");
        convolution(name + "conv2", name + "bn3");
        if (first) convolution(name + "downsample.0", name + "downsample.1");
        take("Add");
    }

    void convolution(const std::string& conv, const std::string& norm) {
        const OnnxNode& node = take("Conv");
        const Tensor& weight = input(node, 1);
        put(conv + ".weight", weight);
        if (node.inputs.size() > 2) {
            put_bias_norm(norm, input(node, 2));
        } else {
            batch_norm(norm);
        }
    }

    void batch_norm(const std::string& name) {
        const OnnxNode& node = take("BatchNormalization");
        put(name + ".weight", input(node, 1));
        put(name + ".bias", input(node, 2));
        put(name + ".running_mean", input(node, 3));
        const auto epsilon = node.numbers.find("epsilon");
        const double excess =
            (epsilon == node.numbers.end() ? 1e-5 : epsilon->second) - BatchNorm::epsilon;
        put(name + ".running_var", affine(input(node, 4), 1.0, excess).value());
    }

    /// A batch norm that only adds a bias: variance + epsilon = 1.
    void put_bias_norm(const std::string& name, const Tensor& bias) {
        put(name + ".weight", Tensor::full(bias.shape(), 1.0));
        put(name + ".bias", bias);
        put(name + ".running_mean", Tensor::zeros(bias.shape()));
        put(name + ".running_var", Tensor::full(bias.shape(), 1.0 - BatchNorm::epsilon));
    }

    void slope(const std::string& name) {
        const Tensor& value = input(take("PRelu"), 1);
        put(name + ".weight", value.reshaped({value.size()}));
    }

    void fully_connected(const std::string& name) {
        const OnnxNode& node = take("Gemm");
        const Tensor& weight = input(node, 1);
        const auto transposed = node.numbers.find("transB");
        const bool out_first = transposed != node.numbers.end() && transposed->second != 0.0;
        put(name + ".weight", out_first ? weight : transpose(weight).value());
        put(name + ".bias", input(node, 2));
    }

    void put(const std::string& name, const Tensor& value) {
        file_.tensors.insert_or_assign(name, value);
    }

    const OnnxNode& take(const std::string& operation) {
        if (operation_at(0) != operation) refuse(operation);
        return *nodes_[next_++];
    }

    [[nodiscard]] std::string operation_at(std::size_t ahead) const {
        return next_ + ahead < nodes_.size() ? nodes_[next_ + ahead]->operation : "the end";
    }

    [[noreturn]] void refuse(const std::string& expected) const {
        std::ostringstream name;
        if (next_ < nodes_.size()) name << " (" << nodes_[next_]->name << ")";
        fail<FileError>(source_, ": not an iresnet: operation ", next_, " is ", operation_at(0),
                        name.str(), " where an iresnet has ", expected);
    }

    [[nodiscard]] bool is_pointwise(const OnnxNode& node) const {
        if (node.operation != "Conv" || node.inputs.size() < 2 || !has_tensor(node.inputs[1]))
            return false;
        const Tensor& weight = tensor(node.inputs[1]);
        return weight.rank() == 4 && weight.shape(2) == 1 && weight.shape(3) == 1;
    }

    [[nodiscard]] const Tensor& input(const OnnxNode& node, std::size_t i) const {
        if (i >= node.inputs.size() || !has_tensor(node.inputs[i]))
            fail<FileError>(source_, ": not an iresnet: input ", i, " of ", node.operation, " (",
                            node.name, ") is not a constant of the file");
        return tensor(node.inputs[i]);
    }

    [[nodiscard]] const std::string& resolved(const std::string& name) const {
        const auto alias = aliases_.find(name);
        return alias == aliases_.end() ? name : alias->second;
    }
    [[nodiscard]] bool has_tensor(const std::string& name) const {
        return graph_.tensors.contains(resolved(name));
    }
    [[nodiscard]] const Tensor& tensor(const std::string& name) const {
        return graph_.tensors.at(resolved(name));
    }

    [[nodiscard]] std::string name_of(const std::vector<int>& blocks) const {
        for (const IresnetDepth& depth : iresnet_depths) {
            if (std::ranges::equal(blocks, depth.blocks)) return depth.name;
        }
        std::ostringstream counts;
        for (const int count : blocks) counts << (counts.tellp() > 0 ? ", " : "") << count;
        fail<FileError>(source_, ": an iresnet with ", counts.str(),
                        " blocks in its stages; known are those of iresnet18, 34, 50, 100 and 200");
    }

    const OnnxGraph& graph_;
    const std::string& source_;
    std::vector<const OnnxNode*> nodes_;
    std::map<std::string, std::string> aliases_;
    std::size_t next_ = 0;
    TensorFile file_;
};

}  // namespace

bool begins_like_iresnet(const OnnxGraph& graph) {
    std::vector<std::string> operations;
    for (const OnnxNode& node : graph.nodes) {
        if (node.operation != "Identity" && node.operation != "Constant")
            operations.push_back(node.operation);
        if (operations.size() == 4) break;
    }
    return operations == std::vector<std::string>{"Conv", "PRelu", "BatchNormalization", "Conv"} ||
           operations == std::vector<std::string>{"Conv", "BatchNormalization", "PRelu",
                                                  "BatchNormalization"};
}

NamedIresnet iresnet_from_onnx(const OnnxGraph& graph, const std::string& source) {
    return Reader(graph, source).network();
}

}  // namespace stymo
