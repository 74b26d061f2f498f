// SPDX-License-Identifier: Apache-2.0

// Box, gate and line of the Doppler modes as controls: what is drawn of them, what a pointer takes
// hold of, and where it moves it. All places are in the scan plane, mm, so that a window and a page
// do the same.
#pragma once

#include <vector>

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/doppler/colour_box.h"

namespace sonocase::runtime::doppler {

enum class Held { none, box, corner, gate };

// Lines along the colour box's edge, closed.
std::vector<PlanePoint> box_outline(const ScanGeometry& geometry, const DopplerSettings& settings);

// Marks of the spectral gate and of the line of M-mode.
struct GateMarks {
    PlanePoint face, end;             // ends of the line
    PlanePoint upper, lower, middle;  // places of the gate
};
GateMarks gate_marks(const ScanGeometry& geometry, const DopplerSettings& settings);

// What a pointer at a place would drag: the box, its lower right corner, or the gate. reach_mm:
// greatest distance from the pointer to what it takes hold of.
Held hold_at(const ScanGeometry& geometry,
             const DopplerSettings& settings,
             PlanePoint at,
             double reach_mm);

// Moves what is held from one place to another. Everything stays inside the picture.
void drag_held(const ScanGeometry& geometry,
               Held held,
               PlanePoint from,
               PlanePoint to,
               DopplerSettings& settings);

}  // namespace sonocase::runtime::doppler
