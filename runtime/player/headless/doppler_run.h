// SPDX-License-Identifier: Apache-2.0

// The Doppler modes of a run without a window: pictures, measures and sound.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/imaging/doppler/view/doppler_view.h"

namespace sonocase::runtime {

class DopplerRun {
  public:
    // Errors: those of DopplerView::create. The case must outlive the run.
    static Result<DopplerRun> create(CaseView bundle, const ScanEngine& engine);

    bool has_flow() const { return view_.has_flow(); }
    // Box, and gate with its cursor, in the widest vessel of the plane; lines are steered towards
    // its flow.
    struct Aim {
        bool box = true, gate = true, cursor = true, steering = true;
    };
    void aim(const Rigid& mannequin_from_probe, Aim what, DopplerSettings& settings) const;
    // What the recording keeps of the last frame.
    DopplerReport report() const { return view_.report(); }
    // Of the frame that the engine rendered last.
    void frame(const ScanEngine& engine, std::span<const std::uint8_t> pixels);

    // In colour: the picture with its overlay, or with the strip of spectrum or M-mode below it.
    std::span<const std::uint8_t> picture(std::span<const std::uint8_t> pixels,
                                          int width,
                                          int height);
    // {"doppler": {...}}: psv_cm_s, edv_cm_s, mean_cm_s, flow_ml_min and what they were measured
    // with; shown cells and frame rate of a colour box; ms a frame.
    std::string json() const;
    // Error: no spectrum was made, or the file cannot be written.
    Status write_sound(const std::string& path) const;

  private:
    explicit DopplerRun(DopplerView view) : view_(std::move(view)) {}

    DopplerView view_;
    DopplerMode mode_ = DopplerMode::off;
    std::vector<std::uint8_t> rgb_;
    std::vector<float> sound_;
    double sound_hz_ = 0, ms_ = 0, shown_cells_ = 0;
    int frames_ = 0;
};

}  // namespace sonocase::runtime
