// SPDX-License-Identifier: Apache-2.0

// Model `physical`, vectorised across beams. Every arithmetic step is one rounding of single
// precision in fixed order, or integer: the same pixels on every instruction set and thread count.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/simd/worker_pool.h"

namespace sonocase::runtime {

// Milliseconds of the last frame by pass, and what it met.
struct PhysicalPasses {
    double contact_ms = 0, beams_ms = 0, needle_ms = 0, filter_ms = 0, grey_ms = 0, convert_ms = 0;
    bool boundary_met = false, refraction_met = false, hard_met = false, needle_met = false,
         gap_met = false, fine_met = false, target_met = false;
    int beams_in_contact = 0;
};

class PhysicalFast {
  public:
    PhysicalFast(const PhysicalScene& scene,
                 const ScanGeometry& geometry,
                 const physical::Tables& tables,
                 const PhysicalNoise& noise,
                 WorkerPool& workers);

    PhysicalFast(const PhysicalFast&) = delete;
    PhysicalFast& operator=(const PhysicalFast&) = delete;

    // keep_all: also run what cannot show; the pixels are the same.
    void render(const PhysicalFrame& frame,
                const BreathingField& breathing,
                bool flip,
                bool keep_all,
                std::span<std::uint8_t> pixels);
    const PhysicalPasses& passes() const { return passes_; }

    // Of the last frame, in beam space: envelope power of a sample's row (# scanlines), grey of a
    // sample.
    const float* power_row(int sample) const;
    int shade(int sample, int line) const;

  private:
    void find_contact(const PhysicalFrame& frame);
    // breathing: null where nothing moves. first: of a block of beams.
    void place_beams(const PhysicalFrame& frame, const BreathingField* breathing, int first);
    void sample_beams(const PhysicalFrame& frame, const BreathingField& breathing, bool keep_all);
    void filter_rows(const PhysicalFrame& frame);
    void spread_haze(int cell_row, float level, const float* envelope);
    void make_grey(const PhysicalFrame& frame);
    void start_rows() { std::fill(next_row_.begin(), next_row_.end(), -1); }

    const PhysicalScene& scene_;
    const ScanGeometry geometry_;
    const physical::Tables& tables_;
    const PhysicalNoise& noise_;
    WorkerPool& workers_;
    ScanConversionTable conversion_;
    int lines_ = 0, stride_ = 0, pair_stride_ = 0, cells_k_ = 0, cells_l_ = 0;

    std::vector<std::int32_t> looks_, pairs_word_;  // packed
    std::vector<float> r_, contact_, elevation_, interface_scale_, gain_;
    std::vector<float> elevation_off_, fine_frames_;
    std::vector<float> dim_, dim_off_;  // per look: light that one sample leaves
    std::vector<PhysicalTarget> targets_, near_targets_;
    std::vector<std::uint32_t> elevation_start_, lookup_start_, clutter_start_, haze_start_,
        noise_start_;

    std::vector<float> raw_gaps_, gaps_, beams_, breathing_;
    std::vector<float> planes_;  // holds the four below, samples x stride each
    std::int32_t* echoes_ = nullptr;
    float *light_ = nullptr, *tail_ = nullptr, *power_ = nullptr;
    std::vector<std::int32_t> tail_from_;  // per block
    std::vector<float> work_, ring_;       // per thread
    std::vector<int> next_row_;            // per thread: what its ring can go on with
    std::vector<float> envelope_, haze_;   // per thread: sum of a row of cells; # cells x stride
    std::vector<std::uint8_t> shade_;      // per thread: two rows
    std::vector<std::uint16_t> pairs_;
    PhysicalPasses passes_;
};

}  // namespace sonocase::runtime
