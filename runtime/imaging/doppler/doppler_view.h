// SPDX-License-Identifier: Apache-2.0

// The Doppler modes of a renderer's pictures: colour, power, spectral and M-mode.
//
//     auto view = DopplerView::create(bundle, exercise, options);   // the same as the Renderer's
//     renderer.render(input, pixels);
//     view->frame(input, renderer, pixels);      // input.settings.doppler says what is shown
//     compose(pixels, view->overlay(), mode, rgb);
//
// Blood and tissue lie where the picture has them: after contact, breathing and pressing. A
// collapsed vein has no flow. The pulse is that of the arterial walls. With the mode off, frame()
// returns at once.
//
// Part of the portable core: frame() neither throws nor allocates, and gives the same bytes for the
// same inputs in the same order; colour and power depend on the input alone.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/m_mode.h"
#include "runtime/imaging/doppler/spectral_strip.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

class DopplerView {
  public:
    // The bundle must outlive the view. A bundle without flow gives empty boxes and strips.
    // Errors: unknown effects. Cost: 10 ms.
    static Result<DopplerView> create(CaseView bundle,
                                      const Exercise& exercise,
                                      const RenderOptions& options);
    ~DopplerView();
    DopplerView(DopplerView&&) noexcept;
    DopplerView& operator=(DopplerView&&) noexcept;

    bool has_flow() const;

    // input, pixels: those of the frame that `renderer` rendered last.
    void frame(const FrameInput& input,
               const Renderer& renderer,
               std::span<const std::uint8_t> pixels);

    // What the last frame gave. overlay: # pixels; all 0 unless the mode is colour or power.
    std::span<const std::uint8_t> overlay() const;
    const doppler::ColourReport& colour() const;
    const doppler::SpectralStrip& spectrum() const;
    const doppler::MMode& m_mode() const;
    // For the recording and its scores: which vessels were in colour, where the gate stood, what
    // was measured.
    DopplerReport report() const;

    // Settings with the gate across the widest open vessel that the plane cuts inside the sector,
    // the cursor at the true angle, a box around it, and the spectrum's scale so that the fastest
    // blood of a beat fills three quarters of it; nothing where the plane cuts none.
    // steers   a linear probe's lines are steered to either side where that lessens the angle
    // shown    the renderer whose last frame was of `input`: vessels are then taken where breathing
    //          and pressing put them, and none behind bone or gas; null: at rest
    // Cost: 1 ms.
    std::optional<DopplerSettings> aim(const FrameInput& input,
                                       DopplerSettings settings,
                                       bool steers = false,
                                       const Renderer* shown = nullptr) const;
    // The same at rest; settings unchanged where the plane cuts no vessel.
    DopplerSettings aimed(const FrameInput& input,
                          const DopplerSettings& settings,
                          bool steers = false) const {
        return aim(input, settings, steers).value_or(settings);
    }

  private:
    struct Impl;
    explicit DopplerView(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace sonocase::runtime
