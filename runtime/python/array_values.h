// SPDX-License-Identifier: Apache-2.0

// Points, poses and needles as Python gives and takes them, and errors as Python exceptions. Every
// message is one line: what was found, where, and what is expected.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "array_exchange.h"
#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "runtime/imaging/core/control_limits.h"
#include "runtime/imaging/core/frame_input.h"

namespace sonocase::python {

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

// Raises ValueError, "depth_mm: -3 is out of range: give 1 to 500".
double in_range(double value, const std::string& name, double min, double max);

// One value each. name: of the argument, for messages. Raise TypeError where `value` is none, and
// ValueError where it is out of range.
double number_from(py::handle value, const std::string& name);
double number_within(py::handle value, const std::string& name, runtime::Limits<double> limits);
std::int64_t whole_within(py::handle value,
                          const std::string& name,
                          std::int64_t min,
                          std::int64_t max);
std::string text_from(py::handle value, const std::string& name);
std::vector<std::string> names_from(py::handle value, const std::string& name);

// A file's name as the system has it, of text, bytes or os.PathLike, and as Python's text: of any
// bytes but NUL, both ways, as os.fsencode and os.fsdecode.
std::string path_from(py::handle value, const std::string& name);
py::str path_text(const std::string& path);
// An error whose text may hold such a name.
[[noreturn]] void raise_value_error(const std::string& text);

// name: of the argument, for messages. Raise TypeError where `value` is no array of numbers and
// ValueError where its shape or its numbers do not fit.
Rigid rigid_from(py::handle value, const char* name);           // 4 x 4, last row 0 0 0 1
Rigid rigid_from(const double* rows, const std::string& name);  // 16 numbers, row by row
Point3 point_from(py::handle value, const char* name);          // 3
Vector3 vector_from(py::handle value, const char* name);        // 3, not zero

// The pose at `face` whose z is along `beam` and whose x is as near to `lateral` as it can be; some
// axis at right angles where `lateral` is along the beam.
Rigid pose_along(Point3 face, Vector3 beam, Vector3 lateral);

// None: no needle. 4 x 4 mannequin_from_needle (origin at the tip, z from hub to tip), or a pair
// (tip, direction) of three numbers each.
void set_needle(py::handle needle, runtime::FrameInput& input);
// None: the needle moves no tissue. A pair (tent_mm, drag_mm), kDentMmLimits each.
void set_dent(py::handle dent, runtime::FrameInput& input, const char* name);

void copy_rows(const Rigid& pose, double* rows);  // 16, row by row
py::object array_of(const Rigid& pose);           // 4 x 4
py::object array_of(Point3 p);
py::object array_of(Vector3 v);

}  // namespace sonocase::python
