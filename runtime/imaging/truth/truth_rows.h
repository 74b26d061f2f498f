// SPDX-License-Identifier: Apache-2.0

// Labels, shadows and depths of runs of pixels, many at a time. The same bytes on every instruction
// set.
#pragma once

#include <cstddef>
#include <cstdint>

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
    float max_off_vx = 0;  // kMaxOffMm

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
    const std::int32_t* closed_label = nullptr;  // # 256: the label shown where a lumen closed
    bool closes = false;                         // any does
    float lines_per_ray = 1;
    int rays = 0;  // at least 64

    // Breathing; null weight: none.
    const float* weight = nullptr;
    std::int32_t lattice[3];
    float first_vx[3], per_voxel = 0, shift_vx[3];
};

// 16 x 8 pixels whose places all follow from those of six points, by parabolas along the rows and
// straight lines between them. Two points more tell how far off that is.
struct TruthTile {
    static constexpr int kColumns = 16, kRows = 8, kPoints = 8;
    // Of the points, in pixels from the tile's first.
    static constexpr float kBeside[kPoints] = {0, 7.5f, 15, 0, 7.5f, 15, 3.75f, 11.25f},
                           kBelow[kPoints] = {0, 0, 0, 7, 7, 7, 3.5f, 3.5f};
    int column = 0, row = 0;  // its first pixel
    // Of the points: ray, as a fraction that is 0 in the middle of the first and less than the last
    // ray's number, and depth along the beam.
    float ray[kPoints], r_mm[kPoints];
};

// Weights of a row's points in each of its columns.
struct TileColumns {
    float left[TruthTile::kColumns], middle[TruthTile::kColumns], right[TruthTile::kColumns];
};
inline constexpr TileColumns kTileColumns = [] {
    TileColumns w{};
    for (int n = 0; n < TruthTile::kColumns; ++n) {
        const float t = 2.0f * static_cast<float>(n) / (TruthTile::kColumns - 1);
        w.left[n] = 0.5f * (t - 1) * (t - 2);
        w.middle[n] = t * (2 - t);
        w.right[n] = 0.5f * t * (t - 1);
    }
    return w;
}();

// Where the points of a tile are looked up, voxels, and a box of the places of all its pixels.
struct TilePlaces {
    alignas(32) float voxel[3][TruthTile::kPoints];
    float lower[3], upper[3];
};
// The places of a tile's pixels follow where those of its last two points do to within this: a
// sixteenth of a pixel of 512 across a torso, and one step in which a boundary record of a voxel of
// 1 mm holds where its surface lies.
inline constexpr double kMaxOffMm = 0.02;

// True where the places of all pixels follow from those of the points.
bool truth_places(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TruthTile& tile,
                  TilePlaces& places);

// The voxels of a tile's pixels, row by row: where they lie in their bricks, what the table holds
// for these, and the places relative to the voxels' centres.
struct TileVoxels {
    static constexpr int kPixels = TruthTile::kColumns * TruthTile::kRows;
    alignas(64) float x[kPixels], y[kPixels], z[kPixels];
    alignas(64) std::int32_t cell[kPixels], word[kPixels], boundary[kPixels];
};

// Finds the voxels, and asks for them: memory takes its time, so another tile is best worked on
// before these are read. inside: all places lie in the volume.
void truth_voxels(SimdTarget simd,
                  const TruthFrameRows& frame,
                  const TilePlaces& places,
                  bool inside,
                  int rows,
                  TileVoxels& voxels);

// Writes the labels of a tile's pixels, scanned or not; a row of labels is `stride` long. False
// where a lumen may be closed, which the pixels' own places tell.
bool truth_tile(SimdTarget simd,
                const TruthFrameRows& frame,
                const TileVoxels& voxels,
                int rows,
                int columns,
                std::uint8_t* labels,
                std::ptrdiff_t stride);

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

// Where the run's pixels [begin, end) lie at rest, in voxels; NaN where the beam is in air. voxel:
// x, y and z, each of the whole run.
void truth_rest(SimdTarget simd,
                const TruthFrameRows& frame,
                const TruthRun& run,
                int begin,
                int end,
                float* const voxel[3]);

// What follows from a pixel's beam and depth alone; see TruthPlanes. Of a run; null: not wanted.
struct BeamPlanes {
    std::uint8_t* shadowed = nullptr;  // r > first_hard_mm[ray]
    const float* first_hard_mm = nullptr;
    float* depth_mm = nullptr;  // r + gap exp(-r / reach) - entry_mm[ray]
    const float* entry_mm = nullptr;
};
void truth_beams(SimdTarget simd,
                 const TruthFrameRows& frame,
                 const TruthRun& run,
                 const BeamPlanes& planes);

}  // namespace sonocase::runtime
