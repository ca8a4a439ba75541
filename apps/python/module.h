#pragma once

#include <nanobind/nanobind.h>

#include <string>

#include "core/tensor.h"
#include "fit/studio.h"

/// The parts of the module `stymo._stymo`.
namespace stymo::python {

/// Mesh, Face and Model. `bind_engine` must have been called.
void bind_model(nanobind::module_& module);
/// Tensor and grad.
void bind_engine(nanobind::module_& module);
/// Model.decode, which takes tensors.
void bind_decoder(nanobind::class_<Studio>& model);

// Python's arrays and tensors. Both directions share the elements.

/// A contiguous array of float32 or float64 of any library, as a tensor that keeps it alive. Errors
/// call it `name`. Throws TypeError for what is no array or has another element type, ValueError if
/// it is not contiguous.
[[nodiscard]] Tensor tensor_of(nanobind::handle array, const std::string& name);
/// The same for a photo, (height, width, 3): floats in [0, 1], or uint8, which is converted. Throws
/// ValueError for another shape and for floats outside [0, 1].
[[nodiscard]] Tensor photo_of(nanobind::handle array);

/// A read-only NumPy array that keeps the tensor alive.
[[nodiscard]] nanobind::object numpy_of(const Tensor& tensor);
/// A DLPack capsule, which cannot say in its first version that nobody may write.
[[nodiscard]] nanobind::object dlpack_of(const Tensor& tensor, const nanobind::kwargs& arguments);

}  // namespace stymo::python
