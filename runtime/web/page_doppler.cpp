// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/page_doppler.h"

#include "runtime/imaging/doppler/doppler_colours.h"
#include "runtime/imaging/doppler/view/doppler_picture.h"

namespace sonocase::runtime {

Status PageDoppler::begin(const StreamedBundle& bundle, const ScanEngine& engine) {
    if (!bundle.has_flow())
        return Error{"the flow of blood in this case is still loading", "", "wait for the case"};
    auto view = DopplerView::create(bundle, engine.exercise(), engine.render_options());
    if (!view) return view.error();
    view_ = std::make_unique<DopplerView>(std::move(*view));
    return Done{};
}

void PageDoppler::frame(const ScanEngine& engine,
                        const FrameRecord& record,
                        std::span<const std::uint8_t> pixels,
                        bool live) {
    live_ = live;
    mode_ = view_ ? record.input.settings.doppler.mode : DopplerMode::off;
    if (!view_) return;
    const bool strip = mode_ == DopplerMode::spectral || mode_ == DopplerMode::m_mode;
    // A strip runs on with the time of live frames; going back would begin it anew.
    if (live || !strip) view_->frame(record.input, engine.renderer(), pixels);
}

std::span<const std::uint8_t> PageDoppler::overlay() const {
    if (mode_ != DopplerMode::colour && mode_ != DopplerMode::power) return {};
    return view_->overlay();
}

std::span<const std::uint8_t> PageDoppler::strip(int width, int height) {
    if (mode_ != DopplerMode::spectral && mode_ != DopplerMode::m_mode) return {};
    strip_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    if (mode_ == DopplerMode::spectral)
        doppler::draw_spectrum(view_->spectrum(), kStripSeconds, width, height, strip_);
    else
        doppler::draw_m_mode(view_->m_mode(), width, height, strip_);
    return strip_;
}

std::span<const float> PageDoppler::sound() const {
    if (mode_ != DopplerMode::spectral || !live_) return {};
    return view_->spectrum().sound();
}

doppler::SpectralMeasures PageDoppler::measures() const {
    return mode_ == DopplerMode::spectral ? view_->spectrum().measures()
                                          : doppler::SpectralMeasures{};
}

DopplerSettings PageDoppler::aimed(const ScanEngine& engine,
                                   const DopplerSettings& settings) const {
    FrameInput input;
    input.mannequin_from_probe = engine.last().tools.mannequin_from_probe;
    return view_ ? view_->aimed(input, settings) : settings;
}

ScanGeometry doppler_geometry(const ScanEngine& engine) {
    const RenderOptions& options = engine.render_options();
    return make_scan_geometry(engine.exercise().probe, doppler::kColourLines, doppler::kColourRows,
                              options.width_px, options.height_px);
}

}  // namespace sonocase::runtime
