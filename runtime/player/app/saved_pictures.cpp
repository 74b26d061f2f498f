// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/saved_pictures.h"

#include <algorithm>
#include <filesystem>

#include "formats/bundle/case_bundle.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/session/png_file.h"

namespace sonocase::runtime::inline player_app {
namespace {

// A new file; empty, with a notice, if there is no folder for it.
std::string new_file(Notices& notices, const std::string& case_name, const char* ending) {
    const std::string folder = data_folder() + "/pictures";
    std::error_code failed;
    if (!data_folder().empty()) std::filesystem::create_directories(folder, failed);
    if (data_folder().empty() || failed) {
        notices.error("There is no folder to save to: set HOME or XDG_DATA_HOME.");
        return {};
    }
    std::string name = case_name + "_" + utc_now();
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

void tell(Notices& notices, const Status& saved, const std::string& path) {
    if (saved) {
        notices.news({"Saved as {}.", {path}});
    } else {
        notices.error(saved.error().message());
    }
}

}  // namespace

void save_picture(Notices& notices, const CaseState& loaded) {
    if (!loaded.open) return;
    const ScanFrame& frame = loaded.frame();
    const std::string path = frame.width_px > 0 ? new_file(notices, loaded.name(), ".png") : "";
    if (path.empty()) return;
    const bool coloured = !frame.doppler.rgb.empty();
    tell(notices,
         write_png(path, frame.width_px, frame.height_px, coloured ? 3 : 1,
                   coloured ? frame.doppler.rgb : frame.pixels,
                   attribution_of(*loaded.open->bundle)),
         path);
}

void start_clip(Notices& notices, const CaseState& loaded, Console& console) {
    const ScanFrame& frame = loaded.frame();
    if (console.clip || !loaded.open || frame.cine_frames < 2) return;
    const bool was_frozen = console.controls.frozen;
    set_frozen(console, true);
    console.clip = std::make_unique<ClipSaver>(
        frame.cine_frames,
        std::min(frame.cine_frames / std::max(frame.frames_per_s, 1.0), kCineSeconds), was_frozen);
    notices.news("The last 20 s are being saved.");
}

void advance_clip(Notices& notices, const CaseState& loaded, Console& console) {
    if (!console.clip) return;
    ClipSaver& clip = *console.clip;
    // Unfreezing gives it up.
    if (!console.controls.frozen || !loaded.open) {
        console.clip.reset();
        return;
    }
    if (clip.take(loaded.frame())) {
        console.controls.cine_back = clip.wanted_back();
        return;
    }
    if (const std::string path = new_file(notices, loaded.name(), ".gif"); !path.empty())
        tell(notices, clip.write(path), path);
    set_frozen(console, clip.was_frozen());
    console.clip.reset();
}

}  // namespace sonocase::runtime::inline player_app
