// SPDX-License-Identifier: Apache-2.0

// The press field laid out for the beams and samples of one level of a renderer, and a stretch of a
// block of beams as the kernels read it.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/imaging/press/press_plane.h"

namespace sonocase::runtime::press {

inline constexpr int kPressBeams = 16;  // of a block
inline constexpr int kPressRows = 32;   // of a stretch

// Filled by press_chunk() (press_view-inl.h): rows of kPressBeams numbers for samples from `first`.
struct PressChunk {
    int first = 0;
    bool any_closed = false;
    alignas(64) float along[kPressRows * kPressBeams];  // mm, see PlaneShift
    alignas(64) float side[kPressRows * kPressBeams];
    alignas(64) float tilt[kPressRows * kPressBeams];
    alignas(64) float rise[kPressRows * kPressBeams];  // of the rest depth per mm along the beam
    alignas(64) std::int32_t closed[kPressRows * kPressBeams];  // 1: in a lumen that is shut
    const float* row(const float* of, int k) const { return of + (k - first) * kPressBeams; }
};

class PressView {
  public:
    // Allocates; the rest of the class does not.
    PressView(const ScanGeometry& geometry, const PressFace& face);

    // Takes over what is pressed; the field must stay as it is until the frame is drawn. Cost: 25
    // us.
    void show(const PressField& field);

    // The shift of one sample, k < active.
    struct Shift {
        float along_mm = 0, side_mm = 0;
    };
    Shift at(int line, int k) const;

    // What press_chunk() reads.
    const PressField* field = nullptr;
    const ScanGeometry* geometry = nullptr;
    bool columns_follow_beams = true;
    int samples = 0, lines = 0;
    int active = 0;  // samples from here on do not move; a whole number of stretches
    float step_mm = 1, columns_per_mm = 1, per_radius_mm = 0;
    std::vector<float> column;  // of each beam
    std::vector<float> shift;   // # active x kStride: depth at rest less depth shown, mm
    std::vector<float> bulge;   // # kBulgeRows x lines: sideways shift to the place at rest, mm
    std::vector<float> share;   // # samples: 1, fading below the table
    const float* shift_row(int k) const { return shift.data() + k * kStride + kMargin; }
};

}  // namespace sonocase::runtime::press
