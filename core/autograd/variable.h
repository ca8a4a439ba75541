#pragma once

#include <memory>

#include "core/tensor.h"

namespace stymo {

class Node;

/// A tensor and, if it is tracked, its node in the graph. Ops take and return Variables. A Variable
/// is immutable: no operation changes it in place, so values saved for a gradient rule stay valid.
class Variable {
public:
    Variable() = default;
    /// A constant. Ops whose inputs are all constants are not recorded.
    Variable(Tensor value)
        : value_(std::move(value)) {
    }  // NOLINT(google-explicit-constructor): constants mix freely with variables
    Variable(Tensor value, std::shared_ptr<Node> node)
        : value_(std::move(value)), node_(std::move(node)) {}

    /// A leaf of the graph: gradients can be taken with respect to it.
    [[nodiscard]] static Variable leaf(Tensor value);

    [[nodiscard]] const Tensor& value() const { return value_; }
    [[nodiscard]] const Shape& shape() const { return value_.shape(); }
    [[nodiscard]] std::int64_t shape(int axis) const { return value_.shape(axis); }
    [[nodiscard]] int rank() const { return value_.rank(); }
    [[nodiscard]] DType dtype() const { return value_.dtype(); }
    [[nodiscard]] bool defined() const { return value_.defined(); }
    /// Whether gradients can flow to this value: it is a leaf or was computed from one.
    [[nodiscard]] bool tracked() const { return node_ != nullptr; }
    [[nodiscard]] const std::shared_ptr<Node>& node() const { return node_; }
    /// The same value as a constant.
    [[nodiscard]] Variable detach() const { return Variable(value_); }

private:
    Tensor value_;
    std::shared_ptr<Node> node_;
};

}  // namespace stymo
