// SPDX-License-Identifier: Apache-2.0

// sonocase._core: what the Python package sonocase is made of. The stubs beside the package's
// Python files (sonocase/__init__.pyi) describe every class for editors and type checkers.
#include <exception>
#include <utility>

#include "array_values.h"
#include "bindings.h"
#include "sonocase/version.h"

PYBIND11_MODULE(_core, module) {
    using namespace sonocase::python;
    module.doc() = "Frames, labels and scores of case bundles; see the package sonocase.";
    module.attr("__version__") = SONOCASE_VERSION;
    // For as long as the process: its text may hold a file's name that is not UTF-8.
    static const py::handle error = py::exception<OutsideError>(module, "Error").release();
    error.attr("__doc__") =
        "A failure of the outside world: one line that says what was found, where, and what was "
        "expected.";
    py::register_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(std::move(thrown));
        } catch (const OutsideError& e) {
            PyErr_SetObject(error.ptr(), path_text(e.text).ptr());
        }
    });
    bind_array(module);
    bind_exercise(module);
    bind_case(module);
    bind_pose(module);
    bind_truth(module);
    bind_renderer(module);
}
