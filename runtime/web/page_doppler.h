// SPDX-License-Identifier: Apache-2.0

// The Doppler modes of a page: what DopplerFrames and DopplerRun are to the desktop, with an
// overlay and a strip that the page colours itself.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/streamed_bundle.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/box_hands.h"
#include "runtime/imaging/doppler/view/doppler_view.h"

namespace sonocase::runtime {

class PageDoppler {
  public:
    // Before the first frame of a mode, and again for each engine. The bundle must outlive what is
    // made. Error: blood flow has not arrived yet.
    Status begin(const StreamedBundle& bundle, const ScanEngine& engine);
    void end() { view_.reset(); }
    bool begun() const { return view_ != nullptr; }
    bool has_flow() const { return view_ && view_->has_flow(); }

    // Of the frame that the engine rendered last, from `record`. live: false for a kept one, whose
    // strip stays as it was frozen.
    void frame(const ScanEngine& engine,
               const FrameRecord& record,
               std::span<const std::uint8_t> pixels,
               bool live);
    DopplerMode mode() const { return mode_; }  // of the last frame
    DopplerReport report() const { return view_ ? view_->report() : DopplerReport{}; }

    // # pixels of the picture: index into doppler::palette(), 0: grey. Empty: no colour.
    std::span<const std::uint8_t> overlay() const;
    // Grey, # width * height; empty: the mode has none.
    std::span<const std::uint8_t> strip(int width, int height);
    // Pairs of samples of the last live frame (towards, away), and their rate.
    std::span<const float> sound() const;
    double sound_hz() const { return view_ ? view_->spectrum().sound_hz() : 0; }
    doppler::SpectralMeasures measures() const;
    double machine_hz() const { return view_ ? view_->colour().frame_hz : 0; }

    // Settings with box, gate and cursor in the widest vessel of the last picture's plane.
    DopplerSettings aimed(const ScanEngine& engine, const DopplerSettings& settings) const;

  private:
    std::unique_ptr<DopplerView> view_;
    DopplerMode mode_ = DopplerMode::off;
    bool live_ = false;
    std::vector<std::uint8_t> strip_;
};

// Where the lines of the engine's picture run, for what hands see (box_hands.h).
ScanGeometry doppler_geometry(const ScanEngine& engine);

}  // namespace sonocase::runtime
