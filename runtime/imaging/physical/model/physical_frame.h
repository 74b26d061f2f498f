// SPDX-License-Identifier: Apache-2.0

// One frame's input to model `physical`, as both renderers take it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/exercise/motion.h"
#include "runtime/imaging/needle/needle_chord.h"
#include "runtime/imaging/noise/noise.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/physical/model/physical_scene.h"
#include "runtime/imaging/scan/scan_geometry.h"

namespace sonocase::runtime {

struct PhysicalEffects {
    bool contact = true;  // gel gap closed, air gap dark
    bool breathing = true;
    bool pulsation = true;
    bool elevation = true;       // beam thickness across the plane
    bool boundaries = true;      // sub-voxel planes between labels
    bool structure = true;       // echo offsets inside organs
    bool fine_structure = true;  // fibres and septa below the voxel
    bool targets = true;         // balls of the exercise
    bool speckle = true;
    bool interfaces = true;
    bool edge_shadow = true;
    bool attenuation = true;
    bool needle = true;
    bool bone_tail = true;
    bool gas_ring_down = true;
    bool point_spread = true;
    bool near_field = true;
    bool noise = true;
    bool persistence = true;
    bool haze = true;
    bool post_filter = true;
    bool grey_map = true;
};

struct PhysicalFrame {
    Rigid volume_from_probe;
    const NeedleShape* needle = nullptr;  // probe frame
    std::uint32_t seed = 1, frame = 0;
    std::span<const float> row_gain_db;  // # samples: console gain and TGC sliders
    double dynamic_range_db = 60;
    MotionState motion;
    PhysicalEffects effects;
};

// Noise in tiles of signed bytes (32 is one standard deviation), read row by row from random
// starts.
struct PhysicalNoise {
    std::vector<std::int8_t> fine;    // electronic: a few beams wide
    std::vector<std::int8_t> streak;  // clutter: many beams wide
    std::vector<std::int8_t> white;   // beam by beam: places of the slab's samples
};
PhysicalNoise make_physical_noise(std::uint32_t seed, int overhang);

// Rows of the tiles: what they are drawn for, so that no two uses share a draw.
enum class NoiseUse : std::uint32_t {
    elevation = 1,
    lookup,
    electronic_re,
    electronic_im,
    clutter_re,
    clutter_im,
    haze_re,
    haze_im
};
inline std::uint32_t noise_start(std::uint32_t seed, NoiseUse use, std::uint32_t frame, int row) {
    return noise_row_start(seed + 0x51ED270Bu * static_cast<std::uint32_t>(use), frame,
                           static_cast<std::uint32_t>(row));
}

// Frames whose electronic noise persistence blends, newest first; squares sum to 1 at unit weight.
inline constexpr int kPersistedFrames = 4;
inline constexpr std::array<double, kPersistedFrames> kPersistence{0.40, 0.30, 0.20, 0.10};

// Gap between probe face and skin on the beams [first, last), mm; negative: no skin within reach,
// so that the beam sees air. raw: # scanlines.
void find_gaps(const PhysicalScene& scene,
               const ScanGeometry& geometry,
               const PhysicalFrame& frame,
               int first,
               int last,
               std::span<float> raw);
// The mean over neighbouring beams that have skin. Returns the number of beams in contact.
int smooth_gaps(int scanlines, std::span<const float> raw, std::span<float> gaps);

int label_at(const PhysicalScene& scene, int i, int j, int k);

// The slow, obvious renderer: doubles, one sample after the other, the formula beside each line.
// pixels: # width * height.
void render_physical_reference(const PhysicalScene& scene,
                               const ScanGeometry& geometry,
                               const physical::Tables& tables,
                               const PhysicalNoise& noise,
                               const PhysicalFrame& frame,
                               std::span<std::uint8_t> pixels);

}  // namespace sonocase::runtime
