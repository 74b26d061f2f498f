// SPDX-License-Identifier: Apache-2.0

// One frame's input to model `physical`, as both renderers take it, and what both work out from it
// alike: noise, gaps to the skin, places on beams, surfaces of pressed tissue.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/exercise/motion.h"
#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/core/noise.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/physical/model/physical_effects.h"
#include "runtime/imaging/physical/model/physical_scene.h"
#include "runtime/imaging/physical/model/physical_tables.h"
#include "runtime/imaging/press/press_field.h"

namespace sonocase::runtime::physical {

inline constexpr double kMinSlope = 0.2, kMaxSlope = 50;  // limits of the gradient's length

// Effect deformation: turns a surface at rest into that of pressed tissue.
//
// The distance s(x) from the plane at rest is a function of the pressed place p through x(p), so
// that its gradient there is J^T n:
//
//     along the beam    rise (n . beam)
//     beside it         (n . beside) + tilt (n . beam)
//     across the plane  as at rest
//
// rise and tilt: gradient of the rest depth along the beam and beside it; the gradient of the
// sideways shift, below 0.3, is left out. The pressed normal is the gradient's direction, and the
// distance is s over its length: the walls of a closed vein come together.
// normal: unit; it is changed, and so is the distance. beam, beside: unit, at a right angle.
inline void press_surface(
    Vector3 beam, Vector3 beside, double rise, double tilt, Vector3& normal, double& distance_mm) {
    const double along = dot(normal, beam);
    const Vector3 g = normal + ((rise - 1) * along) * beam + (tilt * along) * beside;
    const double length = std::clamp(norm(g), kMinSlope, kMaxSlope);
    normal = (1 / std::max(norm(g), 1e-9)) * g;
    distance_mm /= length;
}

}  // namespace sonocase::runtime::physical

namespace sonocase::runtime {

inline constexpr std::size_t kMaxNeedles = 7;  // of a frame: a needle, a wire's parts, a catheter's

struct PhysicalFrame {
    Rigid volume_from_probe;
    // Probe frame: the needle, and the straight parts of a wire and a catheter.
    std::span<const NeedleShape> needles;
    std::uint32_t seed = 1, frame = 0;
    std::span<const float> row_gain_db;  // # samples: console gain and TGC sliders
    double dynamic_range_db = 60;
    SceneChange::Air air;  // at rest; radius 0: none
    MotionState motion;
    PhysicalEffects effects;
    const press::PressField* press = nullptr;  // null: nothing is pressed
    // Balls of this frame (balls_of_frame()); null: the scene's.
    const std::vector<TargetBall>* balls = nullptr;
};

// Noise in tiles of signed bytes (32 is one standard deviation), read row by row from random
// starts.
struct PhysicalNoise {
    std::vector<std::int8_t> fine;    // electronic: a few beams wide
    std::vector<std::int8_t> streak;  // haze of side lobes: many beams wide
    std::vector<std::int8_t> white;   // independent in each beam: places of samples, clutter
};
// normal_levels: those of PhysicalTextures. overhang: beams, and what a kernel reads beyond them.
// Cost: 3 ms.
PhysicalNoise make_physical_noise(std::span<const double> normal_levels,
                                  std::uint32_t seed,
                                  int overhang);

// What a row of a tile is drawn for, so that no two uses share a draw.
enum class NoiseUse : std::uint32_t {
    elevation = 1,
    lookup,
    electronic_re,
    electronic_im,
    clutter_re,
    clutter_im,
    haze_re,
    haze_im,
    grain
};
inline std::uint32_t noise_start(std::uint32_t seed, NoiseUse use, std::uint32_t frame, int row) {
    return noise_row_start(seed + 0x51ED270Bu * static_cast<std::uint32_t>(use), frame,
                           static_cast<std::uint32_t>(row));
}

// Finds the gap between the probe's face and the skin on the beams [first, last), mm; negative: no
// skin within kMaxGapMm, so that the beam sees air. Where boundary records give the skin within a
// voxel, the gap ends there, otherwise in steps of kGapStepMm at the first voxel of the body. Reads
// voxels on the beams, whose blocks must be loaded. raw: # scanlines.
void find_gaps(const PhysicalScene& scene,
               const ScanGeometry& geometry,
               const PhysicalFrame& frame,
               int first,
               int last,
               std::span<float> raw);
// Takes the mean over neighbouring beams that have skin: four to each side, or, under a flat face,
// whose beams are finer than the voxels of the skin, those within kGapMeanMm. Returns the number of
// beams in contact.
int smooth_gaps(const ScanGeometry& geometry, std::span<const float> raw, std::span<float> gaps);

// While something is pressed, a gap ends at the pressed skin. Beams in air stay in air.
void press_gaps(const press::PressField& field,
                const ScanGeometry& geometry,
                std::span<float> gaps);

// Where the tissue that beam `line` shows at depth r lies when nothing is pressed and nobody
// breathes, in the middle of the slab. line: may lie beyond the last beam. gap_mm: how far a gap to
// the skin moves the sample along the beam.
Point3 point_on_beam(
    const ScanGeometry& geometry, const PhysicalFrame& frame, int line, double r_mm, double gap_mm);
// The same where the shift of the pressed tissue is known.
Point3 point_on_beam(const ScanGeometry& geometry,
                     const PhysicalFrame& frame,
                     int line,
                     double r_mm,
                     double gap_mm,
                     const press::PlaneShift& shift);

// Label of a voxel; 0, the outside, beyond the volume.
int label_at(const PhysicalScene& scene, int i, int j, int k);

}  // namespace sonocase::runtime
