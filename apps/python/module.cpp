#include "apps/python/module.h"

#include <exception>

#include "core/error.h"
#include "core/parallel.h"

namespace nb = nanobind;

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
               "Threads of all calls of this process; 0: one for each processor.");
    stymo::python::bind_engine(module);
    stymo::python::bind_model(module);
}
