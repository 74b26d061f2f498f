// SPDX-License-Identifier: Apache-2.0

// Model `paper` in beam space: beams x depth first, then one scan conversion. The shadow is a
// running product down the beam, and the blur is a filter across beams: no march per pixel, no
// turned copies of the picture. Integer arithmetic in a fixed order: every instruction set and
// thread count gives the same pixels. Cost: about 0.6 ms per frame of 512 x 512 samples and pixels
// on one thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/imaging/core/image_formation.h"
#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/paper/paper_reference.h"
#include "runtime/imaging/press/press_view.h"

namespace sonocase::runtime {

struct PaperBlock;

class PaperFast {
  public:
    // noise: make_paper_noise() of at least as many beams. Scene and noise outlive this.
    PaperFast(const PaperScene& scene,
              const ScanGeometry& geometry,
              std::span<const std::int8_t> noise,
              const press::PressFace& face,
              const RenderContext& context);

    // keep_all: also works out what cannot show; the pixels are the same.
    void render(const PaperFrame& frame, bool flip, bool keep_all, std::span<std::uint8_t> pixels);

    // Times of the last frame, and what it met.
    const PassTimes& pass_ms() const { return pass_ms_; }
    const PaperMet& met() const { return met_; }

  private:
    void set_rows(const PaperFrame& frame);
    PaperBlock block_of_scene(const PaperFrame& frame, std::span<const std::int32_t> flat) const;
    bool place_block(const Rigid& volume_from_probe, int first_line);
    void turn_block(const Rigid& volume_from_probe, int first_line);
    double sample_beams(const PaperFrame& frame, bool keep_all);  // returns the needle's time, ms
    void finish_edges(int block);
    void blur_rows(const PaperFrame& frame);

    const PaperScene& scene_;
    const ScanGeometry geometry_;
    const std::span<const std::int8_t> noise_;
    const RenderContext context_;
    press::PressView press_;
    std::vector<float> directions_;  // see PaperBlock
    ScanConversionTable table_;
    std::vector<std::uint16_t> blur_taps_;  // # 2 * reach + 1, sum 256
    int lines_ = 0;                         // padded to whole blocks
    int stride_ = 0;                        // length of a row: margin, lines, margin
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
    PassTimes pass_ms_{};
    PaperMet met_;
};

}  // namespace sonocase::runtime
