// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/sound_steps.h"

#include <algorithm>
#include <utility>

#include "runtime/player/app/sound_out.h"

namespace sonocase::runtime::inline player_app {
namespace {

// Returns null if sound is off or there is no device.
SoundOut* sound_out(PlayerState& player, CaseState& loaded, Sounds& sounds) {
    if (!player.settings.sound || sounds.failed) return nullptr;
    if (sounds.out) return sounds.out.get();
    auto out = SoundOut::open();
    if (!out) {
        sounds.failed = true;
        player.notices.warning(out.error().message());
        return nullptr;
    }
    sounds.out = std::shared_ptr<SoundOut>(std::move(*out));
    loaded.scan->set_sound(
        [to = sounds.out](std::span<const float> pairs, double hz) { to->play_evened(pairs, hz); });
    return sounds.out.get();
}

}  // namespace

bool heard_target(const SoundState& before, const SoundState& now, bool exam) {
    return !exam && now.targets > before.targets;
}

bool heard_harm(const SoundState& before, const SoundState& now) {
    return now.harm && !before.harm;
}

void toggle_sound(PlayerState& player, Sounds& sounds) {
    bool& on = player.settings.sound;
    on = !on;
    sounds.failed = false;  // a device may have come since
    player.notices.news(on ? "Sound is on." : "Sound is off.");
}

void follow_sounds(PlayerState& player, CaseState& loaded, ScanState& scan) {
    SoundState now;
    if (scan.training.attempt) {
        const AttemptView view = scan.training.attempt->view();
        now.targets = view.targets_hit;
        now.harm = view.in_no_go;
    } else {
        now.targets = static_cast<int>(std::count(scan.training.targets_reached.begin(),
                                                  scan.training.targets_reached.end(), true));
    }
    const SoundState before = std::exchange(scan.sounds.before, now);
    const bool target = heard_target(before, now, scan.training.in_exam()),
               harm = heard_harm(before, now);
    const bool flow = loaded.open && !scan.console.controls.frozen &&
                      scan.console.controls.settings.doppler.mode == DopplerMode::spectral;
    scan.console.controls.sound = flow && player.settings.sound;
    if (!target && !harm && !flow) return;
    SoundOut* out = sound_out(player, loaded, scan.sounds);
    if (!out) return;
    if (harm) {
        out->play(tone(Tone::harm), kToneHz);
    } else if (target) {
        out->play(tone(Tone::target), kToneHz);
    }
}

}  // namespace sonocase::runtime::inline player_app
