// SPDX-License-Identifier: Apache-2.0

// Model `paper` in beam space: beams x depth first, then one scan conversion. The shadow is a
// running product down the beam and the blur a filter across beams, so that no pixel marches and no
// copy is turned. Integer arithmetic of fixed order: every instruction set and thread count gives
// the same pixels.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/imaging/paper/paper_reference.h"
#include "runtime/imaging/simd/worker_pool.h"

namespace sonocase::runtime {

// Milliseconds of the last frame, and what it met.
struct PaperPasses {
    double beams_ms = 0, needle_ms = 0, blur_ms = 0, convert_ms = 0;
    bool shadow_met = false, needle_met = false;
};

class PaperFast {
  public:
    PaperFast(const PaperScene& scene,
              const ScanGeometry& geometry,
              std::uint32_t seed,
              WorkerPool& workers);

    // keep_all: also run what cannot show; the pixels are the same.
    void render(const PaperFrame& frame, bool flip, bool keep_all, std::span<std::uint8_t> pixels);
    const PaperPasses& passes() const { return passes_; }
    std::span<const std::int8_t> noise_tile() const { return noise_; }

  private:
    bool place_block(const Rigid& volume_from_probe, int first_line);

    const PaperScene& scene_;
    const ScanGeometry geometry_;
    WorkerPool& workers_;
    ScanConversionTable table_;
    std::vector<std::int8_t> noise_;
    std::vector<std::uint16_t> blur_taps_;  // # 2 * reach + 1, sum 256
    int lines_ = 0;                         // padded to whole blocks
    int stride_ = 0;                        // of a row: margin, lines, margin
    int margin_ = 0;
    std::vector<std::int32_t> start_, step_;  // # 6 * lines: voxel x, y, z (16.16), texture x, y, z
    std::vector<std::uint32_t> noise_start_;  // # samples
    std::vector<std::uint16_t> row_scale_;    // # samples, 12 fractional bits
    std::vector<double> brightness_;          // # samples
    std::vector<std::uint16_t> stage_;        // per thread: one block of beams
    std::vector<std::uint8_t> image_;         // samples x stride
    std::vector<std::uint8_t> blurred_;       // per thread: two rows
    int pair_stride_ = 0;
    std::vector<std::uint16_t> pairs_;  // samples x pair_stride
    PaperPasses passes_;
};

}  // namespace sonocase::runtime
