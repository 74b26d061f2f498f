// SPDX-License-Identifier: Apache-2.0

// NumPy arrays in and out, and errors as Python exceptions. Every message is one line: what was
// found, where, and what is expected.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <string>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "runtime/imaging/core/frame_input.h"

namespace sonocase::python {

namespace py = pybind11;
using namespace pybind11::literals;

// sonocase.Error: a failure of the outside world, with the text that the programs print.
struct OutsideError : std::exception {
    explicit OutsideError(const Error& error)
        : text(static_cast<const std::string&>(error.message())) {}
    const char* what() const noexcept override { return text.c_str(); }
    std::string text;
};

template <class T>
T value_of(Result<T> result) {
    if (!result) throw OutsideError(result.error());
    return std::move(*result);
}
inline void check(const Status& status) {
    if (!status) throw OutsideError(status.error());
}

// name: of the argument, for messages. Raise TypeError where `value` is no array of numbers and
// ValueError where its shape or its numbers do not fit.
py::array numbers_from(py::handle value, const char* name);
Rigid rigid_from(py::handle value, const char* name);           // 4 x 4, last row 0 0 0 1
Rigid rigid_from(const double* rows, const std::string& name);  // 16 numbers, row by row
Point3 point_from(py::handle value, const char* name);          // 3
Vector3 vector_from(py::handle value, const char* name);        // 3, not zero

// None: no needle. 4 x 4 mannequin_from_needle (origin at the tip, z from hub to tip), or a pair
// (tip, direction) of three numbers each.
void set_needle(py::handle needle, runtime::FrameInput& input);
// None: the needle moves no tissue. A pair (tent_mm, drag_mm), limited as in needle_shift.h.
void set_dent(py::handle dent, runtime::FrameInput& input, const char* name);

py::array_t<double> array_of(const Rigid& pose);  // 4 x 4
py::array_t<double> array_of(Point3 p);
py::array_t<double> array_of(Vector3 v);

}  // namespace sonocase::python
