// SPDX-License-Identifier: Apache-2.0

// What Python's arguments say of a frame, checked: each error names the argument and what it takes.
#pragma once

#include <cstdint>
#include <vector>

#include "frame_renderer.h"
#include "numpy_values.h"

namespace sonocase::python {

using Bytes = py::array_t<std::uint8_t, py::array::c_style>;

void set_scalars(double time_s, std::int64_t frame, double gain_db, runtime::FrameInput& input);
void set_press(double press_mm, runtime::FrameInput& input);

// One task per pose. poses: (n, 4, 4); needles, times_s: None, or one per pose.
std::vector<FrameTask> batch_tasks(py::handle poses,
                                   py::handle needles,
                                   py::handle times_s,
                                   std::int64_t first_frame,
                                   double gain_db);
// press_mm: one number, or one per frame.
void press_batch(const py::object& press_mm, std::vector<FrameTask>& tasks);
// None, or a pair or None per frame.
void dent_batch(py::handle dents, std::vector<FrameTask>& tasks);

// out itself, if it is a writeable array of bytes of this shape.
py::object checked_out(const py::object& out, const std::vector<py::ssize_t>& shape);

}  // namespace sonocase::python
