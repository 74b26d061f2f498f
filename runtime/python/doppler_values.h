// SPDX-License-Identifier: Apache-2.0

// Console settings of the Doppler modes and what was measured, as Python values.
#pragma once

#include <string>

#include "array_values.h"
#include "runtime/imaging/doppler/doppler_view.h"

namespace sonocase::python {

// "b", "colour", "power", "pw" or "m", as sonoplay's --mode. Raises ValueError for others.
runtime::DopplerMode doppler_mode(const std::string& name);

// Settings by the names of recordings (docs/format.md, part 7): box_left, scale_cm_s, gate_mm, ...
// Those that the dict lacks keep their values. Raises ValueError for unknown names, for values out
// of their limits (runtime/imaging/core/control_limits.h) and for a box without an area.
void apply_doppler(const py::dict& given, runtime::DopplerSettings& settings);
// Takes box, gate and steering of `aim` where the dict does not place them.
void take_aim(const py::dict& given,
              const runtime::DopplerSettings& aim,
              runtime::DopplerSettings& settings);
// By name: (min, max).
py::dict doppler_limits();

// Box, gate, cursor and steering of these settings.
py::dict aim_of(const runtime::DopplerSettings& settings);

// What the view's last frame showed: of a colour box its cells and the frame rate, of a spectrum
// what was measured and what was true there. Labels by name.
py::dict measures_of(const runtime::DopplerView& view,
                     runtime::DopplerMode mode,
                     const std::vector<Label>& labels);

}  // namespace sonocase::python
