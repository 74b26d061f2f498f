// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/scan/doppler_frames.h"

#include <algorithm>

#include "runtime/imaging/doppler/doppler_colours.h"

namespace sonocase::runtime {

void DopplerFrames::add(const ScanEngine& engine, bool live, ScanFrame& out) {
    DopplerFrame& to = out.doppler;
    const FrameInput& input = out.record.input;
    const DopplerMode mode = view_ ? input.settings.doppler.mode : DopplerMode::off;
    to.mode = mode;
    to.has_flow = view_ && view_->has_flow();
    const bool box = mode == DopplerMode::colour || mode == DopplerMode::power;
    const bool strip = mode == DopplerMode::spectral || mode == DopplerMode::m_mode;
    if (!box) to.rgb.clear();
    if (!strip) to.strip.clear();
    if (live) live_mode_ = mode;
    if (mode == DopplerMode::off) return;
    // A strip runs on with the time of live frames; going back would begin it anew.
    if (live || box) view_->frame(input, engine.renderer(), out.pixels);
    if (live) out.record.doppler = view_->report();  // for scores
    if (box) {
        to.colour = view_->colour();
        to.rgb.resize(3 * out.pixels.size());
        doppler::compose(out.pixels, view_->overlay(), mode, to.rgb);
        return;
    }
    to.strip.assign(static_cast<std::size_t>(kStripWidth) * kStripHeight, 0);
    if (mode == DopplerMode::spectral) {
        doppler::draw_spectrum(view_->spectrum(), kStripSeconds, kStripWidth, kStripHeight,
                               to.strip);
        to.measures = view_->spectrum().measures();
        to.gate = view_->spectrum().look();
    } else {
        doppler::draw_m_mode(view_->m_mode(), kStripWidth, kStripHeight, to.strip);
    }
}

std::span<const float> DopplerFrames::sound() const {
    if (!view_ || live_mode_ != DopplerMode::spectral) return {};
    return view_->spectrum().sound();
}

}  // namespace sonocase::runtime
