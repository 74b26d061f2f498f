// SPDX-License-Identifier: Apache-2.0

// The bar under the picture: freezing, the kept frames, pictures to keep; in a replay its time.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

void draw_time_line(Ui& ui, Box rest, PacedTracker& replay) {
    ButtonStyle style;
    style.icon = replay.speed() == 0 ? Icon::live : Icon::pause;
    style.tip = "Play or hold (Space)";
    if (ui.button("play", rest.take_left(56, 8), "", style))
        replay.set_speed(replay.speed() == 0 ? 1 : 0);
    // Slower and faster by factors of two.
    const Box speed = rest.take_right(rest.w < 420 ? 140 : 176, 8);
    char words[24];
    std::snprintf(words, sizeof words,
                  replay.speed() < 1 && replay.speed() > 0 ? "1/%.0f x" : "%.0f x",
                  replay.speed() < 1 && replay.speed() > 0 ? 1 / replay.speed() : replay.speed());
    const int step = ui.stepper("speed", speed, "", words, "Speed (Shift + comma, full stop)");
    if (step != 0) {
        const double now = replay.speed() > 0 ? replay.speed() : 0.5;
        replay.set_speed(std::clamp(step > 0 ? 2 * now : now / 2, 0.125, 8.0));
    }
    const std::string time = clock_words(replay.at_s()) + " / " + clock_words(replay.duration_s());
    const float wide = ui.width(time, Type::body) + 4;
    if (rest.w > wide + 80) ui.text(rest.take_right(wide, 8), time, Type::body, colour::kText);
    double at = replay.at_s();
    if (ui.groove("time", rest, at, 0, std::max(replay.duration_s(), 0.1), 0,
                  "Any moment of the attempt"))
        replay.jump(at - replay.at_s());
}

void draw_kept(Ui& ui, Box rest, ScanControls& controls, Cine& cine, const CineInput& input) {
    const bool frozen = controls.frozen;
    if (frozen) {
        ButtonStyle style;
        style.icon = cine.playing ? Icon::pause : Icon::live;
        style.ghost = true;
        style.tip = "Play what is kept (P)";
        if (ui.button("play", rest.take_left(44, 4), "", style)) cine.playing = !cine.playing;
    }
    std::string words;
    if (!input.enabled) {
        words = tr("Stopped");
    } else if (!frozen) {
        words = tr("Live");
    } else {
        words = input.age_s < 0.05 ? "0.0 s" : text("-%.1f s", input.age_s);
    }
    const float wide = std::max(ui.width(words, Type::body), ui.width("-00.0 s", Type::body)) + 4;
    ui.text(rest.take_right(std::min(wide, rest.w), 8), words, Type::body,
            frozen ? colour::kText : colour::kDim);
    if (rest.w < 60) return;
    const int newest = std::max(input.kept - 1, 1);
    double at = frozen ? newest - controls.cine_back : newest;
    if (ui.groove("cine", rest, at, 0, newest, newest,
                  "The last 20 s; frozen, any of them can be looked at (comma, full stop)",
                  frozen)) {
        controls.cine_back = newest - static_cast<int>(std::lround(at));
        cine.playing = false;
    }
}

}  // namespace

CineRequest draw_cine_bar(
    Ui& ui, const Box& bar, ScanControls& controls, Cine& cine, const CineInput& input) {
    CineRequest request;
    ui.card(bar, "cine");
    Box rest = bar.inset(8);
    ButtonStyle style;
    style.icon = Icon::clip;
    style.tip = "Saves the last 20 s as a film (Shift + F12)";
    style.enabled = input.enabled;
    const bool narrow = rest.w < 420;
    if (!input.replay) {
        if (!narrow) request.save_clip = ui.button("clip", rest.take_right(52, 8), "", style);
        style.icon = Icon::camera;
        style.tip = "Saves this picture as PNG (F12)";
        request.save_picture = ui.button("picture", rest.take_right(52, 8), "", style);
        style.icon = controls.frozen ? Icon::live : Icon::freeze;
        style.chosen = controls.frozen;
        style.enabled = input.enabled;
        style.key = "Space";
        style.tip = "Holds the picture; the last 20 s can be looked through";
        const char* words = controls.frozen ? "Live" : "Freeze";
        // The longer of the two words with its key's cap, so that the bar stays as it is.
        const float wide =
            std::max(ui.width(tr("Live"), Type::bold), ui.width(tr("Freeze"), Type::body)) +
            ui.width(tr("Space"), Type::small) + 74;
        request.toggle_freeze = ui.button(
            "freeze", rest.take_left(narrow ? 120 : std::max(wide, 170.0f), 8), tr(words), style);
        draw_kept(ui, rest, controls, cine, input);
    } else {
        draw_time_line(ui, rest, *input.replay);
    }
    return request;
}

}  // namespace sonocase::runtime::inline player_ui
