#include "apps/python/module.h"

#include <nanobind/ndarray.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace nb = nanobind;

namespace stymo::python {

namespace {

using Array = nb::ndarray<nb::ro, nb::device::cpu>;

/// The array, if it is contiguous and row-major.
Array array_of(nb::handle object, const std::string& name) {
    Array array;
    if (!nb::try_cast<Array>(object, array))
        fail<TypeError>(name, ": a ", Py_TYPE(object.ptr())->tp_name,
                        " is no array of numbers in memory; give a NumPy array");
    if (array.ndim() > Shape::max_rank)
        fail<ValueError>(name, ": ", array.ndim(), " axes; at most ", int{Shape::max_rank});
    std::int64_t expected = 1;
    for (std::size_t axis = array.ndim(); axis-- > 0;) {
        if (array.shape(axis) > 1 && array.stride(axis) != expected)
            fail<ValueError>(name, ": not contiguous; give numpy.ascontiguousarray(...)");
        expected *= static_cast<std::int64_t>(array.shape(axis));
    }
    return array;
}

Shape shape_of(const Array& array) {
    return Shape(std::span(array.shape_ptr(), array.ndim()));
}

[[noreturn]] void refuse_type(const Array& array, const std::string& name, const char* wanted) {
    constexpr std::array kinds{"int", "uint", "float"};
    const auto code = static_cast<std::size_t>(array.dtype().code);
    fail<TypeError>(name, ": elements of type ", code < kinds.size() ? kinds[code] : "",
                    code < kinds.size() ? std::to_string(array.dtype().bits) : "unknown", "; give ",
                    wanted);
}

Tensor shared(Array array, const std::string& name, const char* wanted) {
    const bool is_single = array.dtype() == nb::dtype<float>();
    if (!is_single && array.dtype() != nb::dtype<double>()) refuse_type(array, name, wanted);
    const DType dtype = is_single ? DType::float32 : DType::float64;
    const Shape shape = shape_of(array);
    if (shape.size() == 0) return Tensor(shape, dtype);
    // Nothing writes to it, because this module always holds a second copy of the tensor.
    auto* const elements = static_cast<std::byte*>(const_cast<void*>(array.data()));
    const auto release = [array](std::byte*) mutable {
        const nb::gil_scoped_acquire locked;
        array = {};
    };
    return Tensor::over(shape, dtype, std::shared_ptr<std::byte[]>(elements, release));
}

struct Exported {
    std::vector<std::size_t> shape;
    nb::capsule owner;
};

Exported exported(const Tensor& tensor) {
    auto owner = std::make_unique<Tensor>(tensor);
    const auto extents = tensor.shape().extents();
    Exported result{{extents.begin(), extents.end()},
                    nb::capsule(owner.get(), [](void* pointer) noexcept {
                        delete static_cast<Tensor*>(pointer);
                    })};
    static_cast<void>(owner.release());
    return result;
}

}  // namespace

Tensor tensor_of(nb::handle array, const std::string& name) {
    return shared(array_of(array, name), name, "float32 or float64");
}

Tensor photo_of(nb::handle object) {
    const std::string name = "image";
    Array array = array_of(object, name);
    const Shape shape = shape_of(array);
    if (shape.rank() != 3 || shape[2] != 3 || shape.size() == 0)
        fail<ValueError>(name, ": the shape is ", shape, "; give (height, width, 3)");
    if (array.dtype() == nb::dtype<std::uint8_t>())
        return tensor_from_bytes({static_cast<const std::uint8_t*>(array.data()), array.size()},
                                 shape);
    const Tensor photo =
        shared(std::move(array), name, "uint8, float32 or float64").to(DType::float32);
    const auto outside = [](float value) { return !(value >= 0.0F && value <= 1.0F); };
    if (std::ranges::any_of(photo.values<float>(), outside))
        fail<ValueError>(name, ": floats must be in [0, 1]; give uint8 for values up to 255");
    return photo;
}

nb::object numpy_of(const Tensor& tensor) {
    const Exported array = exported(tensor);
    return dispatch(tensor.dtype(), [&]<class T>(T) {
        return nb::cast(nb::ndarray<nb::numpy, const T>(
            tensor.values<T>().data(), array.shape.size(), array.shape.data(), array.owner));
    });
}

nb::object dlpack_of(const Tensor& tensor, const nb::kwargs& arguments) {
    const Exported array = exported(tensor);
    return dispatch(tensor.dtype(), [&]<class T>(T) {
        auto* const elements = const_cast<T*>(tensor.values<T>().data());
        const nb::object exchanged = nb::cast(nb::ndarray<nb::array_api, T>(
            elements, array.shape.size(), array.shape.data(), array.owner));
        return nb::object(exchanged.attr("__dlpack__")(**arguments));
    });
}

}  // namespace stymo::python

// Messages are those of the tools, one line.
NB_MODULE(_stymo, module) {
    nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
        try {
            std::rethrow_exception(thrown);
        } catch (const stymo::FileError& error) {
            PyErr_SetString(PyExc_OSError, error.what());
        } catch (const stymo::TypeError& error) {
            PyErr_SetString(PyExc_TypeError, error.what());
        } catch (const stymo::ShapeError& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        } catch (const stymo::ValueError& error) {
            PyErr_SetString(PyExc_ValueError, error.what());
        }
    });
    module.attr("__version__") = STYMO_VERSION;
    module.def("set_threads", &stymo::set_thread_count, nb::arg("count"),
               "Threads of all calls of this process; 0: one for each processor. Not while another "
               "thread computes.");
    stymo::python::bind_engine(module);
    stymo::python::bind_model(module);
}
