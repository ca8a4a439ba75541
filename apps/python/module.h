#pragma once

#include <nanobind/nanobind.h>

#include "fit/studio.h"

/// The parts of the module `stymo._stymo`.
namespace stymo::python {

/// Mesh, Face and Model. `bind_engine` must have been called.
void bind_model(nanobind::module_& module);
/// Tensor and grad.
void bind_engine(nanobind::module_& module);
/// Model.decode, which takes tensors.
void bind_decoder(nanobind::class_<Studio>& model);

}  // namespace stymo::python
