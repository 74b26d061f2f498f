// SPDX-License-Identifier: Apache-2.0

// Colour and power Doppler: the overlay of a frame.
//
//     ColourImage image(scene, geometry);
//     image.render(settings, moment, place, grey, overlay);   // one byte per pixel
//
// Per cell of the box: power of blood and of tissue with their velocities along the beam, the wall
// filter, the point spread (0.8 x 1.2 cells), and what the processor estimates from it
// (colour_estimate.h). Velocities are looked up only in blocks of cells that a vessel meets, tissue
// is added only where it moves fast enough to pass the filter ("flash"), and noise is estimated
// only where something can show: the picture is the same as if all cells were worked out, for the
// cost of the blood in the box.
//
// Nothing is allocated after the constructor. Same bytes on every machine.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/doppler/colour_box.h"
#include "runtime/imaging/doppler/colour_estimate.h"
#include "runtime/imaging/doppler/flow_scene.h"

namespace sonocase::runtime::doppler {

// Relative to the power of blood: tissue, and noise at the focus.
inline constexpr double kTissueDb = 40, kNoiseDb = -20;
// How much the blood's signal falls beyond the focus, both ways, dB/cm/MHz (assumed).
inline constexpr double kSignalLoss = 0.5;
// How far above the mean noise power must be for colour to be drawn at a gain of 0 dB.
inline constexpr double kShownDb = 6;

struct ColourMoment {
    double phase = 0;         // phase of the heart beat
    double inspired = 0;      // share of inspiration
    std::uint32_t frame = 0;  // counts colour frames, which may be fewer than those of the picture
    std::uint32_t seed = 1;
};

// What a cell was found to hold, before noise and as shown, for tests and measuring.
struct ColourCell {
    float power = 0;  // power of blood and tissue after the filter
    float truth = 0;  // turns: v / (2 v_N) of blood alone, unwrapped, where the cell holds blood
    bool blood = false;
    bool shown = false;
    float turns = 0;  // as estimated
    int vessel = -1;  // vessel that its blood belongs to
};

struct ColourReport {
    int cells = 0, blood_cells = 0, shown_cells = 0;
    bool flash = false;   // tissue moves fast enough to pass the wall filter
    double frame_hz = 0;  // frame rate of a machine with this box
};

// Frames per second of a machine that sends an ensemble of pulses for each line of the box and one
// pulse for each of grey_lines down to depth_mm; the PRF follows from the Nyquist velocity.
double colour_frame_hz(const ColourBox& box,
                       const DopplerSettings& settings,
                       double frequency_mhz,
                       double depth_mm,
                       int grey_lines = 128);

class ColourImage {
  public:
    ColourImage(const FlowScene& scene,
                const ScanGeometry& geometry,
                double frequency_mhz,
                double focus_mm);

    // grey, overlay: # width * height, not flipped. overlay: 0 where grey shows; colour: 1 to 255,
    // 128 + v / v_N * 127; power: 1 to 255. Cost: docs/flow.md.
    ColourReport render(const DopplerSettings& settings,
                        const ColourMoment& moment,
                        const TissuePlace& place,
                        std::span<const std::uint8_t> grey,
                        std::span<std::uint8_t> overlay);

    // Blood by a formula instead of the scene's vessels, for tests: true where there is some.
    using BloodField = bool (*)(Point3 rest, Vector3& mm_s);
    void use_field(BloodField field) { field_ = field; }

    const ColourBox& box() const { return box_; }
    // A cell of the last frame; line and row count within the box.
    ColourCell cell(int line, int row) const;
    // Cells of a vessel's blood in the last frame: in the box, and those of them that were shown.
    int cells_of(int vessel) const { return cells_of_[vessel]; }
    int shown_cells_of(int vessel) const { return shown_of_[vessel]; }

  private:
    struct Block {
        int line, row, lines, rows;  // cells
        bool blood, active;
    };
    void find_rest(const TissuePlace& place);
    void find_shadow(const TissuePlace& place);
    bool find_flash(const DopplerSettings& settings, const TissuePlace& place);
    bool blood_at(Float3 p,
                  std::span<const std::int32_t> among,
                  Float3 d,
                  const TissuePlace* place,
                  float& along,
                  std::int32_t& vessel);
    void sample_block(Block& block, const DopplerSettings& settings, const TissuePlace& place);
    void add_tissue();
    void clear();
    void blur();
    void estimate(const DopplerSettings& settings, const ColourMoment& moment);
    // The four normals of a cell in a frame.
    const float* draws(std::uint32_t cell, std::uint32_t frame);
    void paint(const DopplerSettings& settings,
               std::span<const std::uint8_t> grey,
               std::span<std::uint8_t> overlay) const;
    std::size_t at(int line, int row) const { return row * kStride + line + kMargin; }

    static constexpr int kMaxPersisted = 4;
    struct CellDraws {
        std::uint64_t whose[kMaxPersisted];  // seed and frame
        float n[kMaxPersisted][4];
    };
    static constexpr int kMargin = 8, kStride = kColourLines + 2 * kMargin;
    static constexpr int kBlockLines = 8, kBlockRows = 16;

    BloodField field_ = nullptr;
    const FlowScene& scene_;
    ScanGeometry geometry_;
    double frequency_mhz_;
    ColourPixels pixels_;
    FlowMoment blood_;
    ColourBox box_;
    std::vector<Block> blocks_;
    std::vector<Float3> nodes_;           // rest places at the corners of the blocks
    std::vector<Float3> node_direction_;  // direction of the beam there, at rest
    std::vector<float> node_tissue_;      // turns of the tissue there
    std::vector<std::int32_t> box_capsules_, block_capsules_;
    std::vector<float> shadow_row_;  // per line: the row below which nothing comes back
    std::vector<float> power_, re_, im_, work_, zeros_;
    WallFilter filter_{0.1};
    std::vector<float> truth_;
    std::vector<std::uint8_t> is_blood_, row_active_;
    std::vector<std::int32_t> vessel_;               // per cell with blood
    std::vector<std::int32_t> cells_of_, shown_of_;  // # vessels
    std::vector<float> turns_, shown_power_;
    std::vector<std::uint8_t> index_;      // index of the colour; 0: not shown
    std::vector<std::uint8_t> no_colour_;  // a row of such indices outside the box
    std::vector<CellDraws> draws_;         // # cells of the whole grid
    std::uint32_t seed_ = 1;
    int dirty_rows_ = 0;        // rows of the planes that the last frame may have written to
    std::vector<float> noise_;  // per row
    ColourReport report_;
};

}  // namespace sonocase::runtime::doppler
