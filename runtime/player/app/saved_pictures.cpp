// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/saved_pictures.h"

#include <algorithm>
#include <filesystem>

#include "formats/bundle/attribution.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/kept/user_folders.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/pictures/png_file.h"

namespace sonocase::runtime {
namespace {

// A new file; empty, with a notice, if there is no folder for it.
std::string new_file(App& app, const char* ending) {
    const std::string folder = data_folder() + "/pictures";
    std::error_code failed;
    if (!data_folder().empty()) std::filesystem::create_directories(folder, failed);
    if (data_folder().empty() || failed) {
        app.view.notices.error("There is no folder to save to: set HOME or XDG_DATA_HOME.");
        return {};
    }
    std::string name = app.loaded.open->bundle->manifest.case_name + "_" + utc_now();
    for (char& c : name) {
        const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') ||
                           (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
        if (!plain) c = '-';
    }
    std::string path = folder + "/" + name + ending;
    for (int n = 2; std::filesystem::exists(path, failed); ++n)
        path = folder + "/" + name + "_" + std::to_string(n) + ending;
    return path;
}

void tell(App& app, const Status& saved, const std::string& path) {
    if (saved) {
        app.view.notices.news("Saved as " + path + ".");
    } else {
        app.view.notices.error(saved.error().message());
    }
}

}  // namespace

void save_picture(App& app) {
    if (!app.loaded.open) return;
    const ScanFrame& frame = app.loaded.frame();
    const std::string path = frame.width_px > 0 ? new_file(app, ".png") : "";
    if (path.empty()) return;
    const bool coloured = !frame.doppler.rgb.empty();
    tell(app,
         write_png(path, frame.width_px, frame.height_px, coloured ? 3 : 1,
                   coloured ? frame.doppler.rgb : frame.pixels,
                   attribution_of(*app.loaded.open->bundle)),
         path);
}

void start_clip(App& app) {
    const ScanFrame& frame = app.loaded.frame();
    if (app.scan.clip || !app.loaded.open || frame.cine_frames < 2) return;
    const bool was_frozen = app.scan.controls.frozen;
    set_frozen(app.scan, true);
    app.scan.clip = std::make_unique<ClipSaver>(
        frame.cine_frames,
        std::min(frame.cine_frames / std::max(frame.frames_per_s, 1.0), kCineSeconds), was_frozen);
    app.view.notices.news("The last 20 s are being saved.");
}

void advance_clip(App& app) {
    if (!app.scan.clip) return;
    ClipSaver& clip = *app.scan.clip;
    // Unfreezing gives it up.
    if (!app.scan.controls.frozen || !app.loaded.open) {
        app.scan.clip.reset();
        return;
    }
    if (clip.take(app.loaded.frame())) {
        app.scan.controls.cine_back = clip.wanted_back();
        return;
    }
    if (const std::string path = new_file(app, ".gif"); !path.empty())
        tell(app, clip.write(path), path);
    set_frozen(app.scan, clip.was_frozen());
    app.scan.clip.reset();
}

}  // namespace sonocase::runtime
