// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/sound_steps.h"

#include <algorithm>
#include <utility>

#include "runtime/player/sound/tones.h"

namespace sonocase::runtime {
namespace {

// Null: sound is off, or there is no device.
SoundOut* sound_out(App& app) {
    Sounds& sounds = app.scan.sounds;
    if (!app.player.settings.sound || sounds.failed) return nullptr;
    if (sounds.out) return sounds.out.get();
    auto out = SoundOut::open();
    if (!out) {
        sounds.failed = true;
        app.view.notices.news(out.error().message());
        return nullptr;
    }
    sounds.out = std::shared_ptr<SoundOut>(std::move(*out));
    app.loaded.scan->set_sound(
        [to = sounds.out](std::span<const float> pairs, double hz) { to->play_evened(pairs, hz); });
    return sounds.out.get();
}

}  // namespace

bool heard_target(const Heard& before, const Heard& now, bool exam) {
    return !exam && now.targets > before.targets;
}

bool heard_harm(const Heard& before, const Heard& now) {
    return now.harm && !before.harm;
}

void toggle_sound(App& app) {
    bool& on = app.player.settings.sound;
    on = !on;
    app.scan.sounds.failed = false;  // a device may have come since
    app.view.notices.news(on ? "Sound is on." : "Sound is off.");
}

void follow_sounds(App& app) {
    Heard now;
    if (app.scan.attempt) {
        const AttemptView view = app.scan.attempt->view();
        now.targets = view.targets_hit;
        now.harm = view.in_no_go;
    } else {
        now.targets = static_cast<int>(
            std::count(app.scan.targets_reached.begin(), app.scan.targets_reached.end(), true));
    }
    const Heard before = std::exchange(app.scan.sounds.heard, now);
    const bool target = heard_target(before, now, app.scan.exam && app.scan.attempt),
               harm = heard_harm(before, now);
    const bool flow = app.loaded.open && !app.scan.controls.frozen &&
                      app.scan.controls.settings.doppler.mode == DopplerMode::spectral;
    app.scan.controls.sound = flow && app.player.settings.sound;
    if (!target && !harm && !flow) return;
    SoundOut* out = sound_out(app);
    if (!out) return;
    if (harm) {
        out->play(tone(Tone::harm), kToneHz);
    } else if (target) {
        out->play(tone(Tone::target), kToneHz);
    }
}

}  // namespace sonocase::runtime
