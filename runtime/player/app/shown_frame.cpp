// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/shown_frame.h"

#include "runtime/player/app/attempt_steps.h"

namespace sonocase::runtime::inline player_app {
namespace {

// The names of the engine in use, made when they are first asked for. Null: they cannot be made.
TissueNames* tissue_names(Notices& notices, CaseState& loaded) {
    NamesInUse& in_use = loaded.names;
    if (!loaded.open || in_use.failed) return nullptr;
    if (in_use.names && in_use.engine == loaded.engine.number) return in_use.names.get();
    in_use.names.reset();
    in_use.engine = loaded.engine.number;
    Result<TissueNames> names = Error{"there is no engine", "", ""};
    Exercise exercise;
    RenderOptions options;
    loaded.scan->with_engine([&](ScanEngine& engine) {
        exercise = engine.exercise();
        options = engine.render_options();
    });
    names = TissueNames::create(loaded.open->bundle, exercise, options);
    if (!names) {
        in_use.failed = true;
        notices.warning(names.error().message());
        return nullptr;
    }
    in_use.names = std::make_unique<TissueNames>(std::move(*names));
    return in_use.names.get();
}

bool fits(const TissueNames& names, const ScanFrame& frame) {
    return frame.width_px == names.width_px() && frame.height_px == names.height_px();
}

}  // namespace

bool may_name_tissue(const ScanState& scan) {
    const Training& training = scan.training;
    return !(training.exam && (training.attempt || training.score) && !scan.replay.runs());
}

std::string name_of_pixel(Notices& notices, CaseState& loaded, int column, int row) {
    const ScanFrame& frame = loaded.frame();
    TissueNames* names = frame.width_px > 0 ? tissue_names(notices, loaded) : nullptr;
    if (!names || !fits(*names, frame)) return {};
    return names->at(frame.record.input, column, row);
}

bool outline_frame(Notices& notices,
                   CaseState& loaded,
                   std::vector<std::uint8_t>& rgb,
                   std::vector<TissueName>& found) {
    const ScanFrame& frame = loaded.frame();
    found.clear();
    TissueNames* names = frame.width_px > 0 ? tissue_names(notices, loaded) : nullptr;
    if (!names || !fits(*names, frame)) return false;
    rgb = frame.doppler.rgb;
    if (rgb.empty()) {
        rgb.resize(3 * frame.pixels.size());
        for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = frame.pixels[i / 3];
    }
    found = names->outline(frame.record.input, rgb);
    return true;
}

void show_frame(
    Notices& notices, CaseState& loaded, Display& display, HoverNames& hover, bool may_name) {
    const ScanFrame& frame = loaded.frame();
    if (frame.width_px <= 0) return;
    const DopplerFrame& doppler = frame.doppler;
    if (!doppler.strip.empty()) display.strip->upload(doppler.strip, kStripWidth, kStripHeight);
    hover.shown.clear();
    const bool outlined =
        hover.outlines && may_name && outline_frame(notices, loaded, hover.rgb, hover.shown);
    if (outlined) {
        display.texture->upload_rgb(hover.rgb, frame.width_px, frame.height_px);
    } else if (!doppler.rgb.empty()) {
        display.texture->upload_rgb(doppler.rgb, frame.width_px, frame.height_px);
    } else {
        display.texture->upload(frame.pixels, frame.width_px, frame.height_px);
    }
}

}  // namespace sonocase::runtime::inline player_app
