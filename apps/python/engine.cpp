#include <nanobind/operators.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <memory>

#include "apps/python/module.h"
#include "core/angle.h"
#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/realtime/view.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stymo::python {

namespace {

/// A tensor that was made with requires_grad, and what `backward` has added up for it.
struct Leaf {
    Variable variable;
    Variable gradient{};
};
using Leaves = std::vector<std::shared_ptr<Leaf>>;

/// Python's Tensor. The engine's gradients are functional; `backward` asks for those of the leaves
/// from which the value was computed.
struct Node {
    Variable value;
    Leaves leaves{};
    std::shared_ptr<Leaf> own{};  ///< if this is a leaf

    [[nodiscard]] Node with(Variable result) const { return {std::move(result), leaves}; }
};

Leaves united(const Node& a, const Node& b) {
    Leaves all = a.leaves;
    for (const auto& leaf : b.leaves)
        if (std::ranges::find(all, leaf) == all.end()) all.push_back(leaf);
    return all;
}

Node made(nb::handle array, bool requires_grad) {
    const Tensor tensor = tensor_of(array, "tensor");
    if (!requires_grad) return {tensor};
    auto leaf = std::make_shared<Leaf>(Leaf{Variable::leaf(tensor)});
    return {leaf->variable, {leaf}, leaf};
}

Variable seed_of(nb::handle gradient) {
    return gradient.is_none() ? Variable() : Variable(tensor_of(gradient, "gradient"));
}

void backward(const Node& y, nb::handle gradient) {
    if (y.leaves.empty())
        fail<GradientError>("backward: no tensor with requires_grad=True leads to this one");
    const Variable dL_dy = seed_of(gradient);
    std::vector<Variable> xs;
    for (const auto& leaf : y.leaves) xs.push_back(leaf->variable);
    const std::vector<Variable> gradients = [&] {
        const nb::gil_scoped_release unlocked;
        return grad(y.value, xs, {.dL_dy = dL_dy});
    }();
    // Leaves may be those of other threads, too.
    for (std::size_t i = 0; i < xs.size(); ++i) {
        Variable& sum = y.leaves[i]->gradient;
        sum = sum.defined() ? sum + gradients[i] : gradients[i];
    }
}

Node gradient_of(const Node& y, const Node& x, nb::handle gradient, bool create_graph) {
    const Variable dL_dy = seed_of(gradient);
    const nb::gil_scoped_release unlocked;
    return {grad(y.value, x.value, {.create_graph = create_graph, .dL_dy = dL_dy}),
            create_graph ? y.leaves : Leaves()};
}

nb::object gradient_array(const Node& node) {
    if (!node.own || !node.own->gradient.defined()) return nb::none();
    return numpy_of(node.own->gradient.value());
}

std::vector<Camera> cameras_of(const Model& model, nb::handle angles, std::int64_t faces) {
    const auto turned = [&](std::span<const double> degrees) {
        return model_camera(model, radians_from_degrees(degrees[0]),
                            radians_from_degrees(degrees[1]), radians_from_degrees(degrees[2]));
    };
    std::vector<Camera> cameras;
    if (angles.is_none()) {
        cameras.assign(static_cast<std::size_t>(faces), turned(std::array{0.0, 0.0, 0.0}));
        return cameras;
    }
    const Tensor rows = tensor_of(angles, "angles").to(DType::float64);
    if (rows.shape() != Shape{faces, 3})
        fail<ValueError>("angles: the shape is ", rows.shape(), "; give (", faces, ", 3)");
    for (std::int64_t i = 0; i < faces; ++i)
        cameras.push_back(
            turned(rows.values<double>().subspan(static_cast<std::size_t>(3 * i), 3)));
    return cameras;
}

Node decode(const Studio& studio, const Node& codes, nb::handle angles, std::int64_t size,
            std::int64_t samples) {
    if (codes.value.rank() != 2 || codes.value.shape(1) != code_size)
        fail<ValueError>("codes: the shape is ", codes.value.shape(), "; give (faces, ", code_size,
                         ")");
    const std::vector<Camera> cameras = cameras_of(studio.model(), angles, codes.value.shape(0));
    const nb::gil_scoped_release unlocked;
    return codes.with(studio.model()
                          .decoder()(split_codes(codes.value), cameras,
                                     {.samples_per_ray = samples, .resolution = size})
                          .images.back());
}

/// Adds an operation on one tensor.
template <auto operation>
void add_unary(nb::class_<Node>& tensor, const char* name) {
    tensor.def(name, [](const Node& x) { return x.with(operation(x.value)); });
}

/// Adds an operator on two tensors, or a tensor and a number in either order.
template <class Operation>
void add_binary(nb::class_<Node>& tensor, const std::string& name, Operation operation) {
    const auto number = [](const Node& like, double value) {
        return Variable(Tensor::scalar(value, like.value.dtype()));
    };
    tensor.def(("__" + name + "__").c_str(),
               [=](const Node& a, const Node& b) {
                   return Node{operation(a.value, b.value), united(a, b)};
               },
               nb::is_operator());
    tensor.def(("__" + name + "__").c_str(),
               [=](const Node& a, double b) { return a.with(operation(a.value, number(a, b))); },
               nb::is_operator());
    tensor.def(("__r" + name + "__").c_str(),
               [=](const Node& b, double a) { return b.with(operation(number(b, a), b.value)); },
               nb::is_operator());
}

void add_operations(nb::class_<Node>& tensor) {
    add_binary(tensor, "add", [](const auto& a, const auto& b) { return a + b; });
    add_binary(tensor, "sub", [](const auto& a, const auto& b) { return a - b; });
    add_binary(tensor, "mul", [](const auto& a, const auto& b) { return a * b; });
    add_binary(tensor, "truediv", [](const auto& a, const auto& b) { return a / b; });
    add_unary<negate>(tensor, "__neg__");
    add_unary<[](const Variable& x) { return sum(x); }>(tensor, "sum");
    add_unary<[](const Variable& x) { return mean(x); }>(tensor, "mean");
    add_unary<stymo::exp>(tensor, "exp");
    add_unary<stymo::log>(tensor, "log");
    add_unary<stymo::sin>(tensor, "sin");
    add_unary<stymo::cos>(tensor, "cos");
    add_unary<stymo::sqrt>(tensor, "sqrt");
    add_unary<square>(tensor, "square");
    add_unary<[](const Variable& x) { return stymo::abs(x); }>(tensor, "abs");
    tensor.def(
        "__matmul__",
        [](const Node& a, const Node& b) {
            return Node{matmul(a.value, b.value), united(a, b)};
        },
        nb::is_operator());
    tensor.def(
        "reshape",
        [](const Node& x, const std::vector<std::int64_t>& shape) {
            return x.with(reshape(x.value, Shape(shape)));
        },
        "shape"_a);
}

}  // namespace

void bind_engine(nb::module_& module) {
    nb::class_<Node> tensor(module, "Tensor",
                            "A value of stymo's own differentiation engine, float32 or float64.");
    tensor
        .def(
            "__init__",
            [](Node* self, nb::handle array, bool requires_grad) {
                new (self) Node(made(array, requires_grad));
            },
            "array"_a, "requires_grad"_a = false,
            nb::sig("def __init__(self, array: numpy.typing.ArrayLike, requires_grad: bool = "
                    "False) -> None"),
            "Shares the elements of a contiguous array, which must not change while the tensor "
            "and what is computed from it are in use.")
        .def_prop_ro(
            "shape",
            [](const Node& x) {
                nb::list extents;
                for (const std::int64_t extent : x.value.shape().extents()) extents.append(extent);
                return nb::tuple(extents);
            },
            nb::sig("def shape(self) -> tuple[int, ...]"))
        .def_prop_ro("requires_grad", [](const Node& x) { return x.value.tracked(); })
        .def_prop_ro("grad", &gradient_array,
                     nb::sig("def grad(self) -> numpy.typing.NDArray | None"),
                     "What `backward` has added up, for a tensor with requires_grad=True.")
        .def("zero_grad",
             [](Node& x) {
                 if (x.own) x.own->gradient = {};
             })
        .def("backward", &backward, "gradient"_a = nb::none(),
             nb::sig("def backward(self, gradient: numpy.typing.ArrayLike | None = None) -> None"),
             "Adds dL/dx to `grad` of each x with requires_grad=True that leads to this tensor. "
             "gradient: dL/d(self), in its shape; 1 for a single element.")
        .def("detach", [](const Node& x) { return Node{x.value.detach()}; })
        .def("item", [](const Node& x) { return x.value.value().item(); })
        .def(
            "numpy", [](const Node& x) { return numpy_of(x.value.value()); },
            nb::sig("def numpy(self) -> numpy.typing.NDArray"), "Read-only, without a copy.")
        .def(
            "__array__",
            [](const Node& x, nb::object dtype, nb::object copy) {
                nb::object array = nb::cast(numpy_of(x.value.value()));
                const bool copies = !copy.is_none() && nb::cast<bool>(copy);
                if (!dtype.is_none()) return array.attr("astype")(dtype, "copy"_a = copies);
                return copies ? array.attr("copy")() : array;
            },
            "dtype"_a = nb::none(), "copy"_a = nb::none())
        .def("__dlpack__",
             [](const Node& x, const nb::kwargs& arguments) {
                 return dlpack_of(x.value.value(), arguments);
             })
        .def("__dlpack_device__", [](const Node&) { return nb::make_tuple(1, 0); });
    add_operations(tensor);
    module.def("grad", &gradient_of, "y"_a, "x"_a, "gradient"_a = nb::none(),
               "create_graph"_a = false,
               nb::sig("def grad(y: Tensor, x: Tensor, gradient: numpy.typing.ArrayLike | None = "
                       "None, create_graph: bool = False) -> Tensor"),
               "dL/dx for a tensor x that leads to y. create_graph: it can be differentiated "
               "again.");
}

void bind_decoder(nb::class_<Studio>& model) {
    model.def("decode", &decode, "codes"_a, "angles"_a = nb::none(), "size"_a = 0, "samples"_a = 32,
              nb::sig("def decode(self, codes: Tensor, angles: numpy.typing.ArrayLike | None = "
                      "None, size: int = 0, samples: int = 32) -> Tensor"),
              "The decoder, as training and fitting use it: codes (B, 306) to images (B, size, "
              "size, 3) in [-1, 1], through which gradients flow.\n\n"
              "angles: (B, 3), yaw, pitch and roll of each face in degrees; None: frontal.");
}

}  // namespace stymo::python
