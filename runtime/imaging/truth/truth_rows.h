// SPDX-License-Identifier: Apache-2.0

// Labels, shadows and depths of runs of pixels, many at a time. The same bytes on every instruction
// set.
#pragma once

#include <cstdint>
#include <span>

#include "runtime/imaging/core/simd_target.h"
#include "runtime/imaging/press/press_view.h"

namespace sonocase::runtime {

// What the tables hold for a brick, side by side: both are wanted at the same time.
struct TruthBrick {
    // An entry of the labels' table where the brick holds several labels, else kOneLabel | label,
    // and kHasSurface where one of its voxels has a record.
    std::uint32_t word = 0;
    std::uint32_t boundary = 0;  // the entry of the table of boundary records
};
inline constexpr std::uint32_t kOneLabel = 0x80000000u, kHasSurface = 0x100u;

// What a label is, in the bits above its number.
inline constexpr std::int32_t kArtery = 0x100, kVein = 0x200, kHard = 0x400;  // casts a shadow

// What all rows of a frame share. Coordinates are voxels of the bundle's grid.
struct TruthFrameRows {
    // A pixel's voxel: origin + column * across + row * down; in double, rounded once per row.
    double origin[3], across[3], down[3];
    std::int32_t size[3];

    // Voxels of the bundle. bricks: x fastest, and one more for all places outside. The pools and
    // boundary_uniform are BrickVolume's.
    const TruthBrick* bricks;
    std::int32_t bricks_x, bricks_xy, outside;  // number of the brick for places outside
    const std::int32_t *label_pool, *boundary_pool, *boundary_uniform;
    bool plain_boundaries = false;  // each value of boundary_uniform is kNoBoundary
    std::int32_t label_count;
    const std::int32_t* labels;  // # 256: each number, and the bits of what it is
    float pulse_vx = 0;          // outward shift of arterial walls
    float vein_vx = 0;           // of the walls of veins

    // The fine region, with its own size, words and pulse; null: none. Its box, and its voxel
    // coordinates: per_voxel * those of the case + first.
    const TruthFrameRows* region = nullptr;
    float region_lower[3], region_upper[3], region_per_voxel = 1, region_first[3];

    // Contact; null gap: no beam has one. Per ray.
    const float* gap_mm = nullptr;
    float per_reach = 0;         // log2 e / reach, 1/mm
    float beam_x[3], beam_z[3];  // voxels per mm along the probe's x and z
    bool fan = true;
    float radius_mm = 0, mm_per_px = 0, origin_x_px = 0, origin_y_px = 0;

    // Tissue that moves under probe and needle; null: none does.
    const press::PressView* press = nullptr;
    const std::int32_t* closed_label = nullptr;  // # labels: the label shown where a lumen closed
    float lines_per_ray = 1;
    int rays = 0;  // at least 64

    // Breathing; null weight: none.
    const float* weight = nullptr;
    std::int32_t lattice[3];
    float first_vx[3], per_voxel = 0, shift_vx[3];
};

// The least and greatest of the probe's shifts over some nodes and samples of a press view, mm.
struct PressRange {
    float along[2], side[2];
};
PressRange press_range(SimdTarget simd,
                       const press::PressView& view,
                       int first_node,
                       int last_node,
                       int first_sample,
                       int last_sample);

// One run of pixels.
struct TruthRun {
    int row = 0, begin = 0, count = 0;   // pixels of the picture
    const std::uint16_t* ray = nullptr;  // # count, and a vector's width of slack
    const float* r_mm = nullptr;         // depth along the beam; likewise
};

// Writes labels of the run's pixels [begin, end). labels: of the whole run.
void truth_labels(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  int begin,
                  int end,
                  std::uint8_t* labels);

// shadowed[i] = r > first_hard_mm[ray].
void truth_shadows(SimdTarget simd,
                   const TruthRun& run,
                   std::span<const float> first_hard_mm,
                   std::uint8_t* shadowed);

// depth = r + gap exp(-r / reach) - entry; see TruthPlanes::skin_depth_mm.
void truth_depths(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthRun& run,
                  const float* entry_mm,
                  float* depth_mm);

}  // namespace sonocase::runtime
