// SPDX-License-Identifier: Apache-2.0

#include "numpy_values.h"

#include <cmath>
#include <cstdio>
#include <vector>

namespace sonocase::python {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::string shape_text(const py::array& a) {
    std::string text = "(";
    for (py::ssize_t i = 0; i < a.ndim(); ++i)
        text += (i > 0 ? ", " : "") + std::to_string(a.shape(i));
    return text + (a.ndim() == 1 ? ",)" : ")");
}

// Three numbers.
Vector3 triple(py::handle value, const char* name) {
    const py::array a = numbers_from(value, name);
    if (a.ndim() != 1 || a.shape(0) != 3)
        throw py::value_error(std::string(name) + ": an array of shape " + shape_text(a) +
                              "; give three numbers, mm, frame `mannequin`");
    const Doubles d(a);
    const Vector3 v{d.data()[0], d.data()[1], d.data()[2]};
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
        throw py::value_error(std::string(name) + ": holds a number that is not finite");
    return v;
}

}  // namespace

py::array numbers_from(py::handle value, const char* name) {
    const py::array a = py::array::ensure(value);
    if (!a) {
        PyErr_Clear();
        throw py::type_error(std::string(name) + ": not an array of numbers");
    }
    const char kind = a.dtype().kind();
    if (kind != 'f' && kind != 'i' && kind != 'u')
        throw py::type_error(std::string(name) + ": an array of dtype " +
                             py::cast<std::string>(py::str(a.dtype())) + "; give real numbers");
    return a;
}

Rigid rigid_from(const double* rows, const std::string& name) {
    Rigid pose;
    bool finite = true;
    for (int i = 0; i < 16; ++i) finite = finite && std::isfinite(rows[i]);
    if (!finite)
        throw py::value_error(name +
                              ": holds a number that is not finite; give a rigid motion in mm");
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) pose.rotation(r, c) = rows[4 * r + c];
        pose.translation[r] = rows[4 * r + 3];
    }
    if (rows[12] != 0 || rows[13] != 0 || rows[14] != 0 || rows[15] != 1)
        throw py::value_error(
            name + ": its last row is not 0 0 0 1; the translation, in mm, is the last column");
    const double off = orthonormality_error(pose.rotation);
    if (!(off < 1e-3) || !(determinant(pose.rotation) > 0)) {
        char text[64];
        std::snprintf(text, sizeof text, "%.2g", off);
        throw py::value_error(name + ": not a rigid motion: " +
                              (off < 1e-3 ? std::string("it mirrors")
                                          : std::string("R^T R differs from 1 by ") + text) +
                              "; the limit is 0.001");
    }
    return pose;
}

Rigid rigid_from(py::handle value, const char* name) {
    const py::array a = numbers_from(value, name);
    if (a.ndim() != 2 || a.shape(0) != 4 || a.shape(1) != 4)
        throw py::value_error(std::string(name) + ": an array of shape " + shape_text(a) +
                              "; give 4 x 4, a rigid motion in mm");
    const Doubles d(a);
    return rigid_from(d.data(), name);
}

Point3 point_from(py::handle value, const char* name) {
    return Point3{} + triple(value, name);
}

Vector3 vector_from(py::handle value, const char* name) {
    const Vector3 v = triple(value, name);
    if (!(norm(v) > 0)) throw py::value_error(std::string(name) + ": a direction of length 0");
    return v;
}

void set_needle(py::handle needle, runtime::FrameInput& input) {
    input.has_needle = !needle.is_none();
    if (!input.has_needle) return;
    if (py::isinstance<py::tuple>(needle) && py::len(needle) == 2) {
        const auto pair = py::reinterpret_borrow<py::tuple>(needle);
        input.needle.tip = point_from(pair[0], "needle tip");
        input.needle.direction = normalized(vector_from(pair[1], "needle direction"));
        return;
    }
    const Rigid pose = rigid_from(needle, "needle");
    input.needle.tip = Point3{} + pose.translation;
    input.needle.direction = pose.rotation.column(2);
    input.needle.bevel = pose.rotation.column(0);  // as the player has it
}

void set_dent(py::handle dent, runtime::FrameInput& input, const char* name) {
    if (dent.is_none()) return;
    const py::array a = numbers_from(dent, name);
    if (a.ndim() != 1 || a.shape(0) != 2)
        throw py::value_error(std::string(name) + ": give two numbers, tent_mm and drag_mm");
    const Doubles mm(a);
    if (!std::isfinite(mm.at(0)) || !std::isfinite(mm.at(1)))
        throw py::value_error(std::string(name) + ": not finite");
    input.needle.tent_mm = mm.at(0);
    input.needle.drag_mm = mm.at(1);
}

py::array_t<double> array_of(const Rigid& pose) {
    py::array_t<double> a({4, 4});
    auto m = a.mutable_unchecked<2>();
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) m(r, c) = pose.rotation(r, c);
        m(r, 3) = pose.translation[r];
        m(3, r) = 0;
    }
    m(3, 3) = 1;
    return a;
}

py::array_t<double> array_of(Vector3 v) {
    py::array_t<double> a(3);
    for (int i = 0; i < 3; ++i) a.mutable_at(i) = v[i];
    return a;
}

py::array_t<double> array_of(Point3 p) {
    return array_of(p - Point3{});
}

}  // namespace sonocase::python
