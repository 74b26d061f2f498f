// SPDX-License-Identifier: Apache-2.0

#include "array_values.h"

#include <cmath>
#include <cstdio>

namespace sonocase::python {
namespace {

// Three numbers.
Vector3 triple(py::handle value, const char* name) {
    const Numbers a = numbers_from(value, name);
    if (a.shape != Shape{3})
        throw py::value_error(std::string(name) + ": an array of shape " + shape_text(a.shape) +
                              "; give three numbers, mm, frame `mannequin`");
    const Vector3 v{a.values[0], a.values[1], a.values[2]};
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
        throw py::value_error(std::string(name) + ": holds a number that is not finite");
    return v;
}

}  // namespace

double in_range(double value, const std::string& name, double min, double max) {
    if (value >= min && value <= max) return value;
    char text[96];
    std::snprintf(text, sizeof text, ": %.10g is out of range: give %.10g to %.10g", value, min,
                  max);
    throw py::value_error(name + text);
}

namespace {

[[noreturn]] void refuse_type(py::handle value, const std::string& name, const char* expected) {
    throw py::type_error(name + ": of type " + Py_TYPE(value.ptr())->tp_name + "; give " +
                         expected);
}

// After a call of Python's that may have raised: TypeError, or ValueError where it was a number
// that is too large.
void refuse_raised(py::handle value, const std::string& name, const char* expected) {
    if (PyErr_Occurred() == nullptr) return;
    const bool large = PyErr_ExceptionMatches(PyExc_OverflowError) != 0;
    PyErr_Clear();
    if (large) throw py::value_error(name + ": the number is too large");
    refuse_type(value, name, expected);
}

}  // namespace

double number_from(py::handle value, const std::string& name) {
    const double number = PyFloat_AsDouble(value.ptr());
    refuse_raised(value, name, "a number");
    return number;
}

double number_within(py::handle value, const std::string& name, runtime::Limits<double> limits) {
    return in_range(number_from(value, name), name, limits.min, limits.max);
}

std::int64_t whole_within(py::handle value,
                          const std::string& name,
                          std::int64_t min,
                          std::int64_t max) {
    const auto whole = py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr()));
    refuse_raised(value, name, "a whole number");
    const long long number = PyLong_AsLongLong(whole.ptr());
    refuse_raised(value, name, "a whole number");
    (void)in_range(static_cast<double>(number), name, static_cast<double>(min),
                   static_cast<double>(max));
    return number;
}

std::string text_from(py::handle value, const std::string& name) {
    if (!py::isinstance<py::str>(value)) refuse_type(value, name, "text");
    py::ssize_t size = 0;
    const char* text = PyUnicode_AsUTF8AndSize(value.ptr(), &size);
    if (text == nullptr) {
        PyErr_Clear();
        throw py::value_error(name + ": holds a character that has no UTF-8; give plain text");
    }
    return {text, static_cast<std::size_t>(size)};
}

std::vector<std::string> names_from(py::handle value, const std::string& name) {
    if (!py::isinstance<py::iterable>(value) || py::isinstance<py::str>(value))
        refuse_type(value, name, "a list of names");
    std::vector<std::string> names;
    for (const py::handle one : value) names.push_back(text_from(one, name));
    return names;
}

std::string path_from(py::handle value, const std::string& name) {
    PyObject* bytes = nullptr;
    if (PyUnicode_FSConverter(value.ptr(), &bytes) == 0) {
        const bool is_path = PyErr_ExceptionMatches(PyExc_TypeError) == 0;
        PyErr_Clear();
        if (is_path)
            throw py::value_error(name + ": holds a character that no file's name has, as NUL");
        refuse_type(value, name, "a path: text, bytes or os.PathLike");
    }
    return py::cast<std::string>(py::reinterpret_steal<py::bytes>(bytes));
}

py::str path_text(const std::string& path) {
    return py::reinterpret_steal<py::str>(
        PyUnicode_DecodeFSDefaultAndSize(path.data(), static_cast<py::ssize_t>(path.size())));
}

void raise_value_error(const std::string& text) {
    PyErr_SetObject(PyExc_ValueError, path_text(text).ptr());
    throw py::error_already_set();
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
    const Numbers a = numbers_from(value, name);
    if (a.shape != Shape{4, 4})
        throw py::value_error(std::string(name) + ": an array of shape " + shape_text(a.shape) +
                              "; give 4 x 4, a rigid motion in mm");
    return rigid_from(a.values.data(), name);
}

Point3 point_from(py::handle value, const char* name) {
    return Point3{} + triple(value, name);
}

Vector3 vector_from(py::handle value, const char* name) {
    const Vector3 v = triple(value, name);
    if (!(norm(v) > 0)) throw py::value_error(std::string(name) + ": a direction of length 0");
    return v;
}

Rigid pose_along(Point3 face, Vector3 beam, Vector3 lateral) {
    const Vector3 z = normalized(beam);
    Vector3 x = lateral - dot(lateral, z) * z;
    x = norm(x) > 1e-6 ? normalized(x) : any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), face - Point3{}};
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
    const Numbers mm = numbers_from(dent, name);
    if (mm.shape != Shape{2})
        throw py::value_error(std::string(name) + ": give two numbers, tent_mm and drag_mm");
    const auto within = [&](int i) {
        return in_range(mm.values[i], name, runtime::kDentMmLimits.min, runtime::kDentMmLimits.max);
    };
    input.needle.tent_mm = within(0);
    input.needle.drag_mm = within(1);
}

void copy_rows(const Rigid& pose, double* rows) {
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) rows[4 * r + c] = pose.rotation(r, c);
        rows[4 * r + 3] = pose.translation[r];
        rows[12 + r] = 0;
    }
    rows[15] = 1;
}

py::object array_of(const Rigid& pose) {
    const auto array = new_array<double>({4, 4});
    copy_rows(pose, array.data);
    return array.object;
}

py::object array_of(Vector3 v) {
    const auto array = new_array<double>({3});
    for (int i = 0; i < 3; ++i) array.data[i] = v[i];
    return array.object;
}

py::object array_of(Point3 p) {
    return array_of(p - Point3{});
}

}  // namespace sonocase::python
