// SPDX-License-Identifier: Apache-2.0

// The bar at the top of the scanning page: what is scanned on the left, health on the right. A
// notice stands in the place of the titles: never over the picture.
#include <cstdio>

#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

Icon notice_icon(Notice::Kind kind) {
    return kind == Notice::Kind::error     ? Icon::fail
           : kind == Notice::Kind::warning ? Icon::warn
                                           : Icon::check;
}

unsigned notice_colour(Notice::Kind kind) {
    return kind == Notice::Kind::error     ? colour::kBad
           : kind == Notice::Kind::warning ? colour::kWarn
                                           : colour::kGood;
}

// A small icon and a word, right-aligned; takes its room from `rest`.
void chip(Ui& ui, Box& rest, Icon icon, const std::string& words, unsigned packed) {
    const float wide = 24 + ui.width(words, Type::small) + 12;
    if (wide > rest.w) return;  // the bar gives way: words first
    const Box box = rest.take_right(wide);
    ui.icon(icon, box.x, box.y + 0.5f * box.h - 9, 18, packed);
    ui.text({box.x + 24, box.y, box.w - 24, box.h}, words, Type::small, packed);
}

std::string tracker_words(const TopBarInput& input) {
    std::string words =
        input.tracker.device.empty() ? tr("No tracker") : tr_message(input.tracker.device);
    if (!input.live) return words + " · " + tr("not seen");
    if (input.frame.pose_to_pixel_median_ms > 0)
        words += text(" · %.0f ms", input.frame.pose_to_pixel_median_ms);
    return words;
}

}  // namespace

bool draw_notice(Ui& ui, const Box& box, const Notice& notice) {
    ui.card(box, "notice", colour::kRaised);
    ui.icon(notice_icon(notice.kind), box.x + 10, box.y + 0.5f * box.h - 9, 18,
            notice_colour(notice.kind));
    const std::string sentence = tr_message(notice.text);
    Box words = box.inset(8, 4);
    words.take_left(28);
    const Box close = words.take_right(32);
    const float high = std::min(ui.paragraph_height(words.w, sentence, Type::small), words.h);
    words.y += 0.5f * (words.h - high);
    words.h = high;
    ui.paragraph(words, sentence, Type::small, colour::kText, true);
    ButtonStyle style;
    style.icon = Icon::close;
    style.ghost = true;
    style.tip = "Close this notice";
    return ui.button("dismiss", close, "", style);
}

TopBarRequest draw_top_bar(Ui& ui, const Box& bar, const TopBarInput& input) {
    TopBarRequest request;
    Box rest = bar.inset(8, 2);
    const auto icon_button = [&](const char* id, Icon icon, const char* tip) {
        ButtonStyle style;
        style.icon = icon;
        style.ghost = true;
        style.tip = tip;
        return ui.button(id, rest.take_right(44, 4), "", style);
    };
    ButtonStyle cases;
    cases.icon = Icon::back;
    cases.ghost = true;
    cases.tip = "Back to all cases";
    request.show_cases = ui.button(
        "cases", rest.take_left(52 + ui.width(tr("Cases"), Type::body), 8), tr("Cases"), cases);
    request.show_settings = icon_button("settings", Icon::settings, "Settings and panels");
    request.show_help = icon_button("help", Icon::help, "All keys and gestures (F1)");
    if (input.notice) {
        request.dismiss_notice = draw_notice(ui, rest.inset(0, 1), *input.notice);
        return request;
    }
    if (!input.trainee.empty()) {
        ButtonStyle user;
        user.icon = Icon::user;
        user.ghost = true;
        user.tip = "Sign in as someone else";
        const float wide = 52 + ui.width(input.trainee, Type::body);
        if (wide < 0.25f * rest.w)
            request.sign_in = ui.button("user", rest.take_right(wide, 4), input.trainee, user);
    }
    const std::string device = tracker_words(input);
    ButtonStyle tracker;
    tracker.icon = input.live ? Icon::link : Icon::lost;
    tracker.ghost = true;
    tracker.tip = "Tracker, and time from movement to picture (F9)";
    const float device_width = 54 + ui.width(device, Type::body);
    if (device_width < 0.4f * rest.w) {
        request.show_tracker =
            ui.button("tracker", rest.take_right(device_width, 4), device, tracker);
    } else {
        request.show_tracker = ui.button("tracker", rest.take_right(44, 4), "", tracker);
    }
    // Left: the exercise, which can be changed, and whether it counts.
    const char* mode = input.replays ? "Replay" : input.exam ? "EXAM" : "Practice";
    const float mode_width = ui.width(tr(mode), Type::small) + 20;
    ButtonStyle exercise;
    exercise.icon = Icon::down;
    exercise.ghost = true;
    exercise.tip = "Another exercise of this case (F5)";
    const float wide = std::min(54 + ui.width(input.exercise, Type::body),
                                std::max(rest.w - mode_width - 16, 60.0f));
    exercise.may_cut = true;
    request.show_exercises =
        ui.button("exercise", rest.take_left(wide, 8), input.exercise, exercise);
    if (rest.w < mode_width) return request;
    const Box chip_box = rest.take_left(mode_width, 8);
    const Box frame{chip_box.x, chip_box.y + 0.5f * chip_box.h - 13, chip_box.w, 26};
    ui.outline(frame, input.exam ? colour::kText : colour::kEdge, 1, 6);
    ui.text(frame, tr(mode), Type::small, input.exam ? colour::kText : colour::kDim, Align::centre);
    if (input.recording) chip(ui, rest, Icon::rec, tr("Recording"), colour::kDim);
    if (!input.server.empty())
        chip(ui, rest, Icon::next, std::string(tr("Serving")) + " " + input.server, colour::kDim);
    return request;
}

}  // namespace sonocase::runtime::inline player_ui
