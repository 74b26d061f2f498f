// SPDX-License-Identifier: Apache-2.0

// The press field laid out for the beams and samples of one level of a renderer, and a stretch of a
// block of beams as the kernels read it.
//
// The probe's shift is worked out for every few beams (nodes, at most 0.7 columns of the field
// apart) at every sample, and is linear between nodes, so that rows need no look-ups. The shifts by
// a needle and by pools are narrower, and are added sample by sample near them.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_field.h"

namespace sonocase::runtime::press {

inline constexpr int kPressBeams = 16;     // beams of a block
inline constexpr int kPressRows = 32;      // rows of a stretch
inline constexpr float kStillMm = 0.002f;  // a smaller shift is drawn as none

// What moves a stretch.
struct PressMovers {
    bool probe = false, needle = false;
    // Over how many samples (1, 4, 8, 16 or 32) the shift by pools is linear to within
    // PressView::kPoolOffMm; 0: no pool moves them.
    int pool_step = 0;
    bool any() const { return probe || needle || pool_step > 0; }
};

// Filled by press_chunk() (press_view-inl.h) but for `movers`, which it reads: rows of kPressBeams
// numbers for samples from `first`.
struct PressChunk {
    PressMovers movers;
    int first = 0;
    bool any_closed = false;  // if not, `closed` is not filled in
    // mm, see PlaneShift; the first row is the sample's before `first`, or its own where first is 0
    alignas(64) float along[(kPressRows + 1) * kPressBeams];
    alignas(64) float side[kPressRows * kPressBeams];
    alignas(64) std::int32_t closed[kPressRows * kPressBeams];  // 1: in a collapsed lumen
    const float* along_row(int k) const { return along + (k - first + 1) * kPressBeams; }
    const float* side_row(int k) const { return side + (k - first) * kPressBeams; }
};

class PressView {
  public:
    // Allocates; the rest of the class does not.
    PressView(const ScanGeometry& geometry, const PressFace& face);

    // Takes over the field, which must stay unchanged until the frame is drawn. Cost: 25 us;
    // nothing where the field has not changed.
    void show(SimdTarget simd, const PressField& field);

    // What moves the samples [first, first + rows) of the beams [line, line + kPressBeams). Cost:
    // 0.1 us with a needle or a pool.
    PressMovers movers(int line, int first, int rows) const;
    static constexpr double kPoolOffMm = 0.02;

    // The shift of one sample, k < active; line <= lines. by_probe: the probe's shift alone.
    struct Shift {
        float along_mm = 0, side_mm = 0;
    };
    Shift at(int line, int k) const;
    Shift by_probe(int line, int k) const {
        if (!pressed || k >= capacity) return {};
        const std::ptrdiff_t node =
            static_cast<std::ptrdiff_t>(k) * node_stride + (line >> every_log2);
        const float part = part_of[line & (every - 1)];
        const float *a = along.data() + node, *s = side.data() + node;
        return {a[0] + part * (a[1] - a[0]), s[0] + part * (s[1] - s[0])};
    }

    // What press_chunk() reads.
    const PressField* field = nullptr;
    const ScanGeometry* geometry = nullptr;
    bool pressed = false;  // by the probe
    bool columns_follow_beams = true;
    int lines = 0;
    // Samples of the planes, a whole number of stretches or all; the probe moves nothing below.
    int capacity = 0;
    int active = 0;  // samples from here on move by less than kStillMm in the field shown
    float step_mm = 1, columns_per_mm = 1, per_radius_mm = 0;
    int every = 1, every_log2 = 0;         // beams between nodes: 1, 2 or 4
    int node_stride = 0;                   // row length of the three planes below
    std::vector<float> along, side, tilt;  // # capacity x node_stride, mm; tilt: see PlaneShift
    // For beam n beyond a node: the node before it, and its part of the way to the next.
    alignas(64) std::int32_t node_of[kPressBeams + 4];
    alignas(64) float part_of[kPressBeams + 4];
    std::vector<float> beams;                      // origin x, z, direction x, z: # lines each
    float first_column = 0, columns_per_line = 0;  // where the beams themselves lie
    const float* beam_row(int number) const {
        return beams.data() + static_cast<std::ptrdiff_t>(number) * lines;
    }

    // Per node or row, for filling in the planes.
    std::vector<float> column;  // # node_stride
    std::vector<float> bulge;   // # kBulgeRows x node_stride: sideways shift to rest, mm
    std::vector<float> share;   // # capacity: 1, fading below the table
    int nodes = 0;              // nodes in use; the others of node_stride pad the rows
    int moving = 0;  // samples, from the face on, that the probe moves by kStillMm or more

  private:
    void cross_columns();
    int pool_step(Point3 middle, double reach_mm) const;

    const PressField* shown_ = nullptr;
    std::uint32_t version_ = 0;
};

}  // namespace sonocase::runtime::press
