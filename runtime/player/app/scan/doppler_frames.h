// SPDX-License-Identifier: Apache-2.0

// The Doppler modes of live and kept frames: overlay, strip and measures, and the sound. The same
// functions as a run without a window draws them with (runtime/player/headless/doppler_run.h).
#pragma once

#include <optional>
#include <span>

#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/view/doppler_view.h"
#include "runtime/player/session/scan_frame.h"

namespace sonocase::runtime {

class DopplerFrames {
  public:
    // Of the engine in use; null: no mode is on.
    void set_view(std::unique_ptr<DopplerView> view) { view_ = std::move(view); }
    bool has_view() const { return view_ != nullptr; }

    // Fills out.doppler from the frame in `out`, which `engine` rendered last. live: false for a
    // frame of the cine loop, whose strip stays as it was frozen. Allocates only when a mode is
    // first shown at a picture's size.
    void add(const ScanEngine& engine, bool live, ScanFrame& out);

    // Pairs of samples (towards, away) of the live frame that was added last; empty outside the
    // spectral mode.
    std::span<const float> sound() const;
    double sound_hz() const { return view_ ? view_->spectrum().sound_hz() : 0; }

  private:
    std::unique_ptr<DopplerView> view_;
    DopplerMode live_mode_ = DopplerMode::off;
};

}  // namespace sonocase::runtime
