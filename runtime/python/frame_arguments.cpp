// SPDX-License-Identifier: Apache-2.0

#include "frame_arguments.h"

#include <cmath>
#include <limits>
#include <optional>

namespace sonocase::python {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

}  // namespace

void set_scalars(double time_s, std::int64_t frame, double gain_db, runtime::FrameInput& input) {
    if (!std::isfinite(time_s)) throw py::value_error("time_s: not finite");
    if (!std::isfinite(gain_db)) throw py::value_error("gain_db: not finite");
    if (frame < 0 || frame > std::numeric_limits<std::uint32_t>::max())
        throw py::value_error("frame: give 0 to 2^32 - 1");
    input.time_s = time_s;
    input.frame = static_cast<std::uint32_t>(frame);
    input.settings.gain_db = gain_db;
}

void set_press(double press_mm, runtime::FrameInput& input) {
    if (!(press_mm >= 0 && press_mm <= 40)) throw py::value_error("press_mm: give 0 to 40");
    input.settings.press_mm = press_mm;
}

void press_batch(const py::object& press_mm, std::vector<FrameTask>& tasks) {
    const Doubles values(numbers_from(press_mm, "press_mm"));
    const bool one = values.ndim() == 0;
    if (!one && !(values.ndim() == 1 && values.shape(0) == static_cast<py::ssize_t>(tasks.size())))
        throw py::value_error("press_mm: give one number, or one per pose");
    for (std::size_t n = 0; n < tasks.size(); ++n)
        set_press(values.data()[one ? 0 : n], tasks[n].input);
}

void dent_batch(py::handle dents, std::vector<FrameTask>& tasks) {
    if (dents.is_none()) return;
    if (!PySequence_Check(dents.ptr()) || py::len(dents) != tasks.size())
        throw py::value_error("dents: give one per pose; None for no dent");
    const auto dent_of = py::reinterpret_borrow<py::sequence>(dents);
    for (std::size_t n = 0; n < tasks.size(); ++n) {
        const std::string name = "dents[" + std::to_string(n) + "]";
        set_dent(py::object(dent_of[n]), tasks[n].input, name.c_str());
    }
}

py::object checked_out(const py::object& out, const std::vector<py::ssize_t>& shape) {
    if (!py::isinstance<Bytes>(out))
        throw py::type_error("out: give a C-contiguous array of dtype uint8");
    const Bytes a = py::reinterpret_borrow<Bytes>(out);
    bool fits = a.ndim() == static_cast<py::ssize_t>(shape.size());
    std::string wanted;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        fits = fits && a.shape(static_cast<py::ssize_t>(i)) == shape[i];
        wanted += (i > 0 ? ", " : "") + std::to_string(shape[i]);
    }
    if (!fits) throw py::value_error("out: give an array of shape (" + wanted + ")");
    if (!a.writeable()) throw py::value_error("out: the array is read-only");
    return out;
}

std::vector<FrameTask> batch_tasks(py::handle poses,
                                   py::handle needles,
                                   py::handle times_s,
                                   std::int64_t first_frame,
                                   double gain_db) {
    const py::array a = numbers_from(poses, "poses");
    if (a.ndim() != 3 || a.shape(1) != 4 || a.shape(2) != 4)
        throw py::value_error("poses: give an array of shape (n, 4, 4), rigid motions in mm");
    const Doubles rows(a);
    std::vector<FrameTask> tasks(static_cast<std::size_t>(rows.shape(0)));
    std::optional<Doubles> times;
    if (!times_s.is_none()) {
        times = Doubles(numbers_from(times_s, "times_s"));
        if (times->ndim() != 1 || times->shape(0) != rows.shape(0))
            throw py::value_error("times_s: give one number per pose");
    }
    py::sequence needle_of;
    if (!needles.is_none()) {
        needle_of = py::reinterpret_borrow<py::sequence>(needles);
        if (!PySequence_Check(needles.ptr()) ||
            py::len(needle_of) != static_cast<std::size_t>(rows.shape(0)))
            throw py::value_error("needles: give one per pose; None for no needle");
    }
    for (std::size_t n = 0; n < tasks.size(); ++n) {
        runtime::FrameInput& input = tasks[n].input;
        input.mannequin_from_probe =
            rigid_from(rows.data(static_cast<py::ssize_t>(n)), "poses[" + std::to_string(n) + "]");
        if (!needles.is_none()) set_needle(py::object(needle_of[n]), input);
        set_scalars(times ? times->at(static_cast<py::ssize_t>(n)) : 0,
                    first_frame + static_cast<std::int64_t>(n), gain_db, input);
    }
    return tasks;
}

}  // namespace sonocase::python
