// SPDX-License-Identifier: Apache-2.0

// What the vectorised calls of model `physical` work on.
#pragma once

#include <cstdint>

#include "formats/base/geometry.h"
#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/physical/model/physical_model.h"
#include "runtime/imaging/physical/model/speckle_slice.h"
#include "runtime/imaging/press/press_view.h"

namespace sonocase::runtime {

// A label's acoustic properties in one word: attenuation (bits 0-15, log2 of amplitude per mm there
// and back, 1/4096), kind (16-18), fine structure (19), echo (20-31, signed, 1/16 dB).
enum PackedKind : std::uint32_t {
    kPackedOutside,
    kPackedSoft,
    kPackedFluid,
    kPackedGas,
    kPackedBone
};

inline constexpr int kFineStructureBit = 1 << 19;

// A pair's echo in one word: log2 of the amplitude (bits 0-11, 1/128, + 2048; 0: none), one over
// the thickness (12-19, 1/32 per mm), diffuse (20), refracts (21), own label pulses (22), second
// label pulses (23), split into two layers (24-30, 1/128 mm).
inline constexpr int kPairDiffuse = 1 << 20, kPairRefracts = 1 << 21, kPairOwnPulse = 1 << 22,
                     kPairSecondPulse = 1 << 23;

// Rows of numbers per beam, `lines` apart.
enum BeamNumber {
    kVoxelOrigin = 0,
    kVoxelPerMm = 3,
    kBeam = 6,
    kGap = 9,
    kEdge = 10,           // amplitude that the beam's contact leaves
    kSpeckleOrigin = 11,  // height, u, v; then the same per mm; kSpeckleSides times
    kSpecklePerMm = kSpeckleOrigin + 3,
    // Each row per mm along the beam has one per mm beside it, kSideways rows further. Filled in
    // where tissue is pressed.
    kSideways = kSpeckleOrigin + 6 * physical::kSpeckleSides,
    kBeamNumbers = 2 * kSideways
};

inline constexpr int kRowSlack = 64;   // behind rows and buffers: lanes of the widest vector
inline constexpr int kRowMargin = 16;  // before and behind a row of floats; >= kMaxLateral and 6

inline constexpr int kWorkRows = 4;  // work rows of a thread, for the passes over rows

inline constexpr int kBreathingNode = 16;  // samples between nodes of the breathing weight

// Effect wall: distances at nodes, `lines` of the block apart, and the tables of sheets.
struct PhysicalWall {
    const float *depth = nullptr, *above = nullptr, *course = nullptr;
    const std::uint8_t* active = nullptr;  // per row of nodes: something shows below it
    const float *outer = nullptr, *inner = nullptr;
    int outer_steps = 0, inner_steps = 0;  // of a course
    float steps_per_mm = 1;
    int every = 1, rows = 0;          // samples between nodes; samples that can show a sheet
    float per_row = 1, per_mm = 1;    // one over samples, and over mm, between nodes
    float ground = 0;                 // level of the ground between sheets, 1/16 dB
    std::int32_t max_structure = 64;  // limit of coarse structure, 1/16 dB
};

// Effect streaks: a plate, see model/streak_plates.h.
struct PhysicalStreak {
    float x = 0, z = 0, normal_x = 0, normal_z = 1;  // mm, in the plane
    float per_width = 1, per_length = 1;             // 1 / deviation; 2 / length
    float bend = 0;                                  // deviations, at half its length
    float amplitude = 0;
    float ripple = 0, per_ripple = 0, phase = 0;  // log2; cycles in half its length
    int sample_begin = 0, sample_end = 0;
};
inline constexpr int kBlockStreaks = 768;  // in a block of beams: all that a frame shows

struct PhysicalTarget {
    float x = 0, y = 0, z = 0, radius_mm = 0;  // centre in voxels
    float reach_mm = 0;
    bool round = true;
    float shape[6] = {};         // xx, yy, zz, xy, xz, yz
    std::int32_t acoustics = 0;  // index; it follows those of the labels
    float wall = 0;
    bool fluid = false;
    bool anywhere = false;  // shows in fluid as well
    bool covers = false;    // hides the surfaces of the tissue in it
    // Free fluid (TargetBall): the label that it takes the place of, -1: no free fluid; a plane.
    std::int32_t only_label = -1;
    float level_up[3] = {};
    float level_mm = 0;
};

// The part of physical::SpeckleSide that is not worked out per beam.
struct SpeckleCut {
    float u_per_height = 0, v_per_height = 0, per_normal = 1;
    std::uint32_t base = 0;
    std::int32_t until = 65536;  // patches whose draw is below this take it
    float shift[3] = {0, 0, 0};  // breathing shift at weight 1: height, u, v
};

inline constexpr int kFineNumbers = 11;  // numbers of a label's frame

// The fine region: see model/region_look_up.h. Its tables are like those of PhysicalBlock.
struct PhysicalRegion {
    const std::int32_t *table = nullptr, *labels = nullptr, *boundary = nullptr;
    Int3 size;
    int blocks_x = 0, blocks_xy = 0, block_log2 = 3;
    float lower[3] = {0, 0, 0}, upper[3] = {0, 0, 0};  // its box, in voxels of the case
    float per_voxel = 1;                               // its voxels per voxel of the case
    float voxel_size = 1;                              // voxels of the case per voxel of it
    float first[3] = {0, 0, 0};  // where the case's voxel (0, 0, 0) lies, in its voxels
    float step_mm = 0;           // 1/48 of its voxels
};

struct PhysicalBlock {
    const float* beams = nullptr;
    int lines = 0, samples = 0;
    const float *r = nullptr, *contact = nullptr, *elevation = nullptr, *interface_scale = nullptr,
                *gain = nullptr;
    float across[3] = {0, 0, 0};    // voxels per mm across the plane
    float sideways[3] = {0, 0, 0};  // voxels per unit of look-up jitter
    const std::int8_t* white = nullptr;
    const std::uint32_t *elevation_start = nullptr, *lookup_start = nullptr;

    const float* breathing = nullptr;  // weight at nodes, `lines` apart; null: nothing moves
    float shift_voxel[3] = {0, 0, 0};
    float pulse_mm = 0;
    float vein_mm = 0;                      // outward shift of the walls of veins
    const std::int32_t* is_vein = nullptr;  // # labels: 1 for veins

    // Effect deformation; null: nothing is pressed.
    const press::PressView* press_view = nullptr;
    press::PressChunk* press = nullptr;          // the stretch's; null: nothing moves in it
    const std::int32_t* closed_label = nullptr;  // per label: what is shown of it when collapsed
    int first_beam = 0;                          // first beam of the block

    const std::int32_t *table = nullptr, *labels = nullptr, *echo = nullptr, *boundary = nullptr;
    const std::int32_t *acoustics = nullptr, *pairs = nullptr, *rough = nullptr;  // packed
    const std::int8_t* fine = nullptr;             // six cubes; null: off
    const std::int32_t* structure_dead = nullptr;  // per label: dead zone, 1/16 dB; null: none
    const std::int32_t* max_structure = nullptr;   // per label, 1/16 dB; null: no limit
    const float* fine_frames = nullptr;      // per label: rows of the frame, offset and last layer
    const PhysicalRegion* region = nullptr;  // null: the case has none
    const PhysicalWall* wall = nullptr;      // null: off
    const float* face_mm = nullptr;          // per beam: face of gas; null: not known
    const float *face_peak = nullptr, *cosine = nullptr, *face_tail = nullptr,
                *reverb_loss = nullptr;  // GasFaces
    const float* dome_mm = nullptr;      // null: none
    float dome_scale = 1, mirror_light = 0;
    const PhysicalStreak* streaks = nullptr;
    int streak_count = 0;
    const float* plane = nullptr;  // beams in the plane, `lines` apart: origin x, z, direction x, z
    const PhysicalTarget* targets = nullptr;
    const SampleRange* target_rows = nullptr;  // samples of the block that each can show in
    int target_count = 0;
    Int3 size;
    int blocks_x = 0, blocks_xy = 0, block_log2 = 3;  // of the table: BrickTable
    int label_count = 0;
    SpeckleCut cuts[physical::kSpeckleSides];
    int cut_count = 1;
    float patch_per_voxel = 1;
    const float* per_spacing = nullptr;  // per row: one over the distance of a column's scatterers
    const float* speckle_level = nullptr;            // per row: makes the filtered field's power 1
    const int* looks_at = nullptr;                   // per row: number of looks that are drawn
    std::ptrdiff_t look_stride = 0;                  // from one look's echoes to the next's
    const float *dim = nullptr, *dim_off = nullptr;  // per label: light that one sample leaves
    float dead_light = 0;
    struct {
        float bone = 0, bone_slow = 0, bone_floor = 0, gas = 0;
    } decay;                 // what a sample leaves of the tails
    float reverb_mm = 0.5f;  // half the width of a line of reverberation
    float voxel_mm = 1, rough_per_voxel = 2, roughness_mm = 0.28f, step_mm = 0.3f;
    bool structure = true, speckled = true, interfaces = true, edge_shadow = true,
         attenuation = true;
    bool bone_tail = true, gas_tail = true;
    bool keep_all = false;
    bool hard_scene = true;  // some label is bone or gas

    // These point to the block's first beam. Echoes are complex amplitudes: the upper halves of two
    // floats (8 bits of precision each) in one word, real part on top, so that a frame fits in the
    // second-level cache.
    std::int32_t* echoes = nullptr;
    float *light = nullptr, *tail = nullptr;
    float* clutter = nullptr;  // power of the reverberation below what is bright; null: none
    float clutter_keep = 0, clutter_gain = 0;
    int stride = 0;
    int tail_from = 0;  // out: first sample with a tail; samples if none
    bool boundary_met = false, refraction_met = false, hard_met = false, fine_met = false,
         target_met = false, dome_met = false, wall_met = false, parenchyma_met = false;  // out
};

// A row's filter across the beams, and the noise that reaches the receiver with it.
struct PhysicalRowTask {
    int lines = 0, scanlines = 0;
    const std::int32_t* echoes = nullptr;
    const float* light = nullptr;
    const float* lateral = nullptr;  // centre tap
    int reach = 0;
    bool point_spread = true;
    // Work rows with margins.
    float *work_re = nullptr, *work_im = nullptr, *work_light = nullptr, *work_clutter = nullptr;
    float *out_re = nullptr, *out_im = nullptr;  // for the first look
    int looks = 1;
    std::ptrdiff_t look_stride = 0, out_stride = 0;  // from look to look: of echoes, of `out`

    // Noise is added to the first look, as much as all looks together have.
    float inverse_gain = 1, near_field = 0, noise = 0;
    const float* tail = nullptr;              // null: none
    const std::int32_t* tail_from = nullptr;  // per block
    int sample = 0;
    const float* clutter = nullptr;  // power, with margins; null: none
    int clutter_reach = 0;           // its mean takes this many beams to each side
    float clutter_drawn = 1;         // share of it that varies
    const std::int8_t *clutter_re = nullptr, *clutter_im = nullptr;
    const float* slides = nullptr;  // GasFaces::slides; null: no lung slides
    const std::int8_t *lung_re[2] = {nullptr, nullptr}, *lung_im[2] = {nullptr, nullptr};
    float lung_weight[2] = {1, 0};  // physical::LungGrain
    int noise_rows = 0;             // 0: none
    const std::int8_t* noise_re[physical::kMaxPersisted] = {};
    const std::int8_t* noise_im[physical::kMaxPersisted] = {};
    float noise_weight[physical::kMaxPersisted] = {};
};

// A row's light, and that of the row above it after it has spread (model/physical_tables.h).
struct PhysicalSpreadTask {
    int lines = 0;
    const float* above = nullptr;  // with margins
    float* light = nullptr;        // in: as the tissue leaves it; out: spread
    float* was = nullptr;          // in: the row above as the tissue leaves it; out: this row
    int beams = 1;
    float share = 0;
};

// A row's filter along the beams; the envelope's power.
struct PhysicalPowerTask {
    int lines = 0;
    const float* const* re = nullptr;  // rows of the filter, first look
    const float* const* im = nullptr;
    int looks = 1;
    std::ptrdiff_t look_stride = 0;
    const float* axial = nullptr;  // first tap
    int axial_count = 1;
    float gain = 1;
    float steady = 0;                // power that the looks leave of the near field's ringing
    const float* clutter = nullptr;  // null: none
    int clutter_reach = 0;
    float clutter_steady = 0;  // share of it that does not vary
    float* work_clutter = nullptr;
    float* envelope_sum = nullptr;  // the envelope is added to it; null: not needed
    float* power = nullptr;
};

// Haze, log compression and the post-filter's lateral half.
struct PhysicalGreyTask {
    int lines = 0, scanlines = 0;
    const float* power = nullptr;
    const float *haze_above = nullptr, *haze_below = nullptr;  // null: none
    float haze_mix = 0;
    const std::int8_t* haze_re[2] = {nullptr, nullptr};  // rows to blend
    const std::int8_t* haze_im[2] = {nullptr, nullptr};
    float haze_first = 1, haze_second = 0;
    const float *even_above = nullptr, *even_below = nullptr;  // gain of power; null: none
    // Effect speckle_reduction: log2 of power about which detail changes, contrast - 1; null: none.
    const float *middle_above = nullptr, *middle_below = nullptr;
    const float *change_above = nullptr, *change_below = nullptr;
    float even_mix = 0;                  // the lower row's part, for these and for the gain
    const std::int8_t* grain = nullptr;  // null: none
    float grain_log2 = 0;                // log2 of power per step of the draw
    // Logarithm: grey = offset + per_log2 log2(power). Otherwise grey is the floor plus 2 to that
    // power, and rises less steeply above the knee.
    float offset = 0, per_log2 = 0, low = 0;
    bool logarithm = true;
    float floor = 0, knee = 255, knee_slope = 1;
    bool filtered = true;
    float* work = nullptr;   // with margins
    float* plain = nullptr;  // null: not needed; grey before the filter
    float* out = nullptr;
};

// The post-filter's axial half, the grey map, and bytes.
struct PhysicalShadeTask {
    int lines = 0;
    const float *above = nullptr, *here = nullptr, *below = nullptr;  // grey rows
    bool filtered = true, grey_map = true;
    const float* plain = nullptr;  // grey before the filter, where its weight is not 1
    float filter_weight = 1;
    std::uint8_t* out = nullptr;
};

}  // namespace sonocase::runtime
