// SPDX-License-Identifier: Apache-2.0

// Model `physical`, vectorised across beams, in three passes over the beams and a scan conversion.
// First, beams into the anatomy, block by block: echoes, light and tails of every sample. Second,
// row by row: the point spread across and along the beams, noise, and the envelope's power. Third:
// haze, equalisation, compression and post-filter, to grey.
//
// Every arithmetic step is one rounding of single precision in a fixed order, or integer: the same
// pixels on every instruction set and thread count. Agrees with physical_reference.h to within
// rounding. Cost: about 1.5 ms per frame of 192 x 512 samples and 512 x 512 pixels on one thread.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/image_formation.h"
#include "runtime/imaging/physical/fast/cell_rows.h"
#include "runtime/imaging/physical/fast/node_lattice.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/gas_faces.h"
#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/physical/model/streak_plates.h"

namespace sonocase::runtime {

class PhysicalFast {
  public:
    // All arguments outlive this, except the geometry, which is copied.
    PhysicalFast(const PhysicalScene& scene,
                 const ScanGeometry& geometry,
                 const physical::Tables& tables,
                 const PhysicalNoise& noise,
                 const press::PressFace& face,
                 const RenderContext& context);

    PhysicalFast(const PhysicalFast&) = delete;
    PhysicalFast& operator=(const PhysicalFast&) = delete;

    // keep_all: also works out what cannot show; the pixels are the same.
    void render(const PhysicalFrame& frame,
                const BreathingField& breathing,
                bool flip,
                bool keep_all,
                std::span<std::uint8_t> pixels);

    // Times of the last frame, and what it met.
    const PassTimes& pass_ms() const { return pass_ms_; }
    const PhysicalMet& met() const { return met_; }
    void describe(RenderedFrame& rendered) const;
    // The last frame in beam space: the envelope's power in a row of samples (# scanlines), and the
    // grey of a sample.
    const float* power_row(int sample) const;
    int shade(int sample, int line) const;

  private:
    // First pass. first: first beam of a block of beams, or first node of a block of nodes.
    void find_contact(const PhysicalFrame& frame);
    void place_beams(const PhysicalFrame& frame, int first);
    void weigh_breathing(const PhysicalFrame& frame, const BreathingField& breathing, int first);
    void choose_acoustics(const PhysicalFrame& frame);
    void choose_targets(const PhysicalFrame& frame, bool keep_all);
    void set_poses(const PhysicalFrame& frame, PhysicalBlock& block) const;
    void set_tables(const PhysicalFrame& frame, PhysicalBlock& block) const;
    PhysicalBlock block_of_frame(const PhysicalFrame& frame, bool keep_all) const;
    void place_targets(const PhysicalFrame& frame,
                       const PhysicalBlock& block,
                       std::span<SampleRange> out) const;
    int choose_streaks(int first, std::span<PhysicalStreak> out) const;
    void prepare_nodes(const physical::Tables& tables);
    void place_nodes(const PhysicalFrame& frame, bool breathes, int first);
    void press_nodes(int first, int end);
    void find_faces(const PhysicalFrame& frame, const PhysicalBlock& base, int first);
    void search_nodes(const PhysicalFrame& frame, const PhysicalBlock& base, bool breathes);
    void show_faces(int line, PhysicalBlock& block) const;
    int wall_node_rows() const { return wall_.rows / wall_.every + 2; }
    void place_wall(bool keep_all, int first, PhysicalWall& wall);
    // Returns the time that the needle took, ms.
    double sample_beams(const PhysicalFrame& frame, const BreathingField& breathing, bool keep_all);
    void mirror_row(float* row, int reach) const;
    void mirror_rows(float* plane, int reach) const;
    void spread_light();
    void join_tails();
    void meet_machine(const PhysicalFrame& frame);

    // Second and third pass.
    void filter_rows(const PhysicalFrame& frame);
    void fill_row_task(const PhysicalFrame& frame, int sample, PhysicalRowTask& task) const;
    void spread_haze(int cell_row, float level, const float* envelope);
    bool reduces_speckle(const PhysicalFrame& frame) const {
        return frame.effects.speckle_reduction && has_speckle_reduction(tables_) &&
               !scene_.layers.empty();
    }
    void make_grey(const PhysicalFrame& frame);
    void fill_grey_task(const PhysicalFrame& frame, int sample, PhysicalGreyTask& task) const;
    void start_rows() { std::fill(next_row_.begin(), next_row_.end(), -1); }

    const PhysicalScene& scene_;
    const ScanGeometry geometry_;
    const physical::Tables& tables_;
    const PhysicalNoise& noise_;
    const RenderContext context_;
    press::PressView press_;
    bool presses_ = false, contact_found_ = false;  // in the last frame
    ScanConversionTable conversion_;
    int lines_ = 0, stride_ = 0, pair_stride_ = 0, cells_k_ = 0, cells_l_ = 0;

    PhysicalRegion region_;
    // Packed: see physical_kernels.h. Acoustics without effect wall, with it, and as the frame's
    // effects want them.
    std::vector<std::int32_t> acoustics_, acoustics_wall_, frame_acoustics_, pairs_word_;
    std::vector<float> r_, contact_, elevation_, interface_scale_, gain_;
    std::vector<float> elevation_off_, fine_frames_;
    std::vector<std::int32_t> max_structure_, structure_dead_;
    std::vector<float> dim_, dim_off_;  // per label: light that one sample leaves
    std::vector<PhysicalTarget> targets_, near_targets_;
    std::vector<std::uint32_t> elevation_start_, lookup_start_, clutter_start_, haze_start_,
        noise_start_;

    std::vector<physical::Streak> streaks_;
    int streak_count_ = 0;
    std::vector<float> plane_beams_;  // origin x, z, direction x, z; # lines each
    NodeLattice nodes_;
    std::vector<physical::FaceNode> faces_of_nodes_;
    std::vector<std::int32_t> node_kinds_;  // per label: see node_lattice.h
    std::vector<int> node_of_;              // per beam: the node before it
    std::vector<float> node_part_;          // per beam: its part of the way to the next node
    physical::GasFaces faces_;
    bool faces_found_ = false, wall_shows_ = false;
    PhysicalWall wall_;                      // the part that all blocks share
    std::vector<float> layer_nodes_;         // depth, above, strength at nodes of beams
    std::vector<float> wall_nodes_;          // the same at every beam
    std::vector<std::uint8_t> wall_active_;  // per block and row of nodes
    std::vector<float> raw_gaps_, gaps_, beams_, breathing_;
    physical::SpeckleSlice slice_;  // the frame's
    std::vector<float> per_spacing_, per_spacing_thin_, speckle_level_, speckle_level_bare_;
    std::vector<int> looks_drawn_;
    std::vector<float> planes_;       // holds the planes below, samples x stride each
    std::int32_t* echoes_ = nullptr;  // one plane per look
    std::ptrdiff_t look_stride_ = 0;
    float *light_ = nullptr, *tail_ = nullptr, *power_ = nullptr;
    float* clutter_ = nullptr;                             // null: the machine has none
    std::vector<std::int32_t> tail_from_, own_tail_from_;  // per block; own: before join_tails()
    std::vector<float> work_, ring_;                       // per thread
    std::vector<int> next_row_;  // per thread: the row that its ring is ready for
    CellRows cells_;
    EqualiserRows equaliser_;
    ContrastRows contrast_;
    std::vector<float> envelope_, haze_;  // per thread: sum of a row of cells; # cells x stride
    std::vector<std::uint8_t> shade_;     // per thread: two rows
    std::vector<std::uint16_t> pairs_;
    PassTimes pass_ms_{};
    PhysicalMet met_;
};

}  // namespace sonocase::runtime
