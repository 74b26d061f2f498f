// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/shown_frame.h"

#include "runtime/player/app/attempt_steps.h"

namespace sonocase::runtime {
namespace {

// Those of the engine in use; made when they are first asked for. Null: they cannot be made.
TissueNames* tissue_names(App& app) {
    TissueLook& look = app.view.look;
    CaseState& loaded = app.loaded;
    if (!loaded.open || look.failed) return nullptr;
    if (look.names && look.engine == loaded.engine_number) return look.names.get();
    look.names.reset();
    look.engine = loaded.engine_number;
    Result<TissueNames> names = Error{"there is no engine", "", ""};
    Exercise exercise;
    RenderOptions options;
    loaded.scan->with_engine([&](ScanEngine& engine) {
        exercise = engine.exercise();
        options = engine.render_options();
    });
    names = TissueNames::create(loaded.open->bundle, exercise, options);
    if (!names) {
        look.failed = true;
        app.view.notices.warning(names.error().message());
        return nullptr;
    }
    look.names = std::make_unique<TissueNames>(std::move(*names));
    return look.names.get();
}

bool fits(const TissueNames& names, const ScanFrame& frame) {
    return frame.width_px == names.width_px() && frame.height_px == names.height_px();
}

}  // namespace

bool may_name_tissue(const App& app) {
    return !(app.scan.exam && (app.scan.attempt || app.scan.score) && !replays(app.scan));
}

std::string name_of_pixel(App& app, int column, int row) {
    if (!may_name_tissue(app)) return {};
    const ScanFrame& frame = app.loaded.frame();
    TissueNames* names = frame.width_px > 0 ? tissue_names(app) : nullptr;
    if (!names || !fits(*names, frame)) return {};
    return names->at(frame.record.input, column, row);
}

bool outline_frame(App& app, std::vector<std::uint8_t>& rgb, std::vector<TissueName>& found) {
    const ScanFrame& frame = app.loaded.frame();
    found.clear();
    TissueNames* names = frame.width_px > 0 ? tissue_names(app) : nullptr;
    if (!names || !fits(*names, frame)) return false;
    rgb = frame.doppler.rgb;
    if (rgb.empty()) {
        rgb.resize(3 * frame.pixels.size());
        for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = frame.pixels[i / 3];
    }
    found = names->outline(frame.record.input, rgb);
    return true;
}

void show_frame(App& app) {
    ViewState& view = app.view;
    const ScanFrame& frame = app.loaded.frame();
    if (frame.width_px <= 0) return;
    const DopplerFrame& doppler = frame.doppler;
    if (!doppler.strip.empty()) view.strip->upload(doppler.strip, kStripWidth, kStripHeight);
    view.look.shown.clear();
    const bool outlined = view.look.outlines && may_name_tissue(app) &&
                          outline_frame(app, view.look.rgb, view.look.shown);
    if (outlined) {
        view.texture->upload_rgb(view.look.rgb, frame.width_px, frame.height_px);
    } else if (!doppler.rgb.empty()) {
        view.texture->upload_rgb(doppler.rgb, frame.width_px, frame.height_px);
    } else {
        view.texture->upload(frame.pixels, frame.width_px, frame.height_px);
    }
}

}  // namespace sonocase::runtime
