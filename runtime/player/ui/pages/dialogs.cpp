// SPDX-License-Identifier: Apache-2.0

// What is open over the page: help, settings, exercises, signing in, details of tracker and
// effects, a new target.
#include <imgui.h>

#include <cmath>
#include <cstdio>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/educator/new_target.h"
#include "runtime/player/app/progress_steps.h"
#include "runtime/player/app/tracker_steps.h"
#include "runtime/player/ui/layout/scan_layout.h"
#include "runtime/player/ui/pages/pages.h"
#include "runtime/player/ui/pages/shortcuts.h"
#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/said.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {

Box begin_page_dialog(Ui& ui, App& app, const char* title, float width, float height) {
    const Box all = ui.window().inset(8);
    const float w = std::min(width, all.w), h = std::min(height, all.h);
    const Box box{all.x + 0.5f * (all.w - w), all.y + 0.5f * (all.h - h), w, h};
    ui.begin_layer(title, box, true);
    Box room = box.inset(16, 12);
    Box head = room.take_top(44, 8);
    Look look;
    look.icon = Icon::close;
    look.ghost = true;
    look.tip = "Close (Esc)";
    if (ui.button("close", head.take_right(44, 8), "", look)) app.view.dialog = Dialog::none;
    ui.text(head, tr(title), Type::heading);
    return room;
}

namespace {

// The parts that Dear ImGui lays out: a child in the room, which scrolls.
template <class Draw>
void flow(Ui& ui, const Box& room, const char* id, const Draw& draw) {
    const float s = ui.scale();
    ImGui::SetCursorScreenPos({room.x * s, room.y * s});
    ImGui::BeginChild(id, {room.w * s, room.h * s}, false);
    draw();
    ImGui::EndChild();
}

void draw_help(App& app, Ui& ui) {
    const Box room = begin_page_dialog(ui, app, "Help", 900, 780);
    flow(ui, room, "keys", [&] {
        const float s = ui.scale();
        const int columns = room.w > 700 ? 4 : 2;
        if (!ImGui::BeginTable("keys", columns)) return;
        const auto all = shortcuts();
        const std::size_t rows = columns == 2 ? all.size() : (all.size() + 1) / 2;
        for (int c = 0; c < columns; c += 2) {
            ImGui::TableSetupColumn("keys", ImGuiTableColumnFlags_WidthFixed, 150 * s);
            ImGui::TableSetupColumn("does");
        }
        const auto cell = [&](const Shortcut& entry) {
            ImGui::PushFont(fonts().small);
            if (!entry.keys) {
                ImGui::PopFont();
                ImGui::PushFont(fonts().bold);
                ImGui::TextWrapped("%s", tr(entry.does));
                ImGui::TableNextColumn();
            } else {
                ImGui::TextWrapped("%s", tr(entry.keys));
                ImGui::TableNextColumn();
                ImGui::PushStyleColor(ImGuiCol_Text, colour::kDim);
                ImGui::TextWrapped("%s", tr(entry.does));
                ImGui::PopStyleColor();
            }
            ImGui::PopFont();
        };
        for (std::size_t i = 0; i < rows; ++i) {
            ImGui::TableNextRow();
            ImGui::TableNextColumn();
            cell(all[i]);
            if (columns == 2) continue;
            ImGui::TableNextColumn();
            if (i + rows < all.size()) cell(all[i + rows]);
        }
        ImGui::EndTable();
    });
    ui.end_layer();
}

// The name of a row of choices; as wide as in the others where there is room.
void choice_name(Ui& ui, Box& box, const char* words) {
    const float wide = ui.width(tr(words), Type::body) + 2;
    ui.text(box.take_left(box.w > 400 ? std::max(wide, 120.0f) : wide, 8), tr(words), Type::body,
            colour::kDim);
}

void choose_size(App& app, Ui& ui, Box box) {
    choice_name(ui, box, "Size of words");
    Window& window = *app.view.window;
    const double asked = window.asked_scale();
    const int step =
        ui.stepper("size", box, "", text("%.0f %%", 100 * asked), "Ctrl + plus and minus");
    if (step == 0) return;
    app.player.settings.ui_scale = std::clamp(std::round(asked * 10 + step) / 10, 0.8, 4.0);
    window.set_scale(static_cast<float>(app.player.settings.ui_scale));
}

void choose_language(App& app, Ui& ui, Box box) {
    choice_name(ui, box, "Language");
    int i = 0;
    const int count = static_cast<int>(languages().size());
    for (const Language& language : languages()) {
        Look look;
        look.chosen = &language == &language_in_use();
        if (ui.button(language.code, box.column(i++, count, 8), language.name, look)) {
            app.player.settings.language = language.code;
            use_language(language.code);
        }
    }
}

void choose_picture(App& app, Ui& ui, Box box) {
    choice_name(ui, box, "Picture");
    struct Choice {
        const char *model, *machine, *name, *tip;
    };
    constexpr Choice kChoices[] = {
        {"physical", "", "Modern", "A scanner of today, physically simulated"},
        {"physical", "classic", "Classic", "A scanner of some twenty years ago"},
        {"paper", "", "Simple", "The simple model; fastest"}};
    const ImageChoice& image = app.loaded.image;
    int i = 0;
    for (const Choice& choice : kChoices) {
        Look look;
        look.tip = choice.tip;
        look.chosen = image.model == choice.model &&
                      (image.model == "paper" || image.machine == choice.machine);
        if (!ui.button(choice.name, box.column(i++, 3, 8), tr(choice.name), look)) continue;
        app.loaded.image.machine = choice.machine;
        choose_model(app, choice.model);
    }
}

// Everything that can be opened, so that whatever was closed comes back.
void draw_settings(App& app, Ui& ui) {
    const bool scanning = app.loaded.open && app.view.page == Page::scan;
    const bool low = ui.window().h < 480;  // two rows in one, so that no button is left out
    Box room = begin_page_dialog(ui, app, "Settings", low ? 640.0f : 560.0f, scanning ? 508 : 310);
    Box first = room.take_top(44, 8);
    if (low) choose_language(app, ui, first.take_right(0.47f * first.w, 16));
    choose_size(app, ui, first);
    const float used = ui.scale();
    if (used + 0.005f < app.view.window->asked_scale())
        ui.text(room.take_top(20, 8),
                std::string(tr("This size does not fit the window; it is shown at")) +
                    text(" %.0f %%.", 100.0 * used),
                Type::small, colour::kWarn, Align::left, true);
    if (!low) choose_language(app, ui, room.take_top(44, 8));
    if (scanning) choose_picture(app, ui, room.take_top(44, 8));
    struct Item {
        const char* words;
        Icon icon;
        bool scanning;
        const char* tip;
    };
    static constexpr Item kItems[] = {
        {"Cases", Icon::cases, false, "Back to all cases (F2)"},
        {"Exercises", Icon::target, true, "Another exercise of this case (F5)"},
        {"Sign in", Icon::user, false, "Whose scores are kept"},
        {"Class", Icon::group, false, "Everyone's progress"},
        {"Set-up", Icon::probe, true, "Calibrate probe, needle and mannequin (F3)"},
        {"Tracker", Icon::link, true, "Which tracker, and how it does (F9)"},
        {"Effects", Icon::timer, true, "What each effect costs (F10)"},
        {"3-D view", Icon::cube, true, "Shown or not (V)"},
        {"Instructor", Icon::eye, false, "A second window with target, names and marks"},
        {"New target", Icon::plus, true, "Add your own target to this case"},
        {"Notices", Icon::warn, false, "What was said so far"},
        {"Help", Icon::help, false, "All keys and gestures (F1)"}};
    int i = 0;
    const int columns = low ? 4 : room.w > 420 ? 3 : 2;
    Box row;
    for (const Item& item : kItems) {
        if (item.scanning && !scanning) continue;
        if (i % columns == 0) row = room.take_top(44, 8);
        Look look;
        look.icon = item.icon;
        look.left = true;
        look.tip = item.tip;
        look.chosen = (item.icon == Icon::cube && app.player.settings.show_3d) ||
                      (item.icon == Icon::eye && app.view.instructor.wanted);
        if (row.h < 30 ||
            !ui.button(item.words, row.column(i++ % columns, columns, 8), tr(item.words), look))
            continue;
        ViewState& view = app.view;
        view.dialog = Dialog::none;
        switch (item.icon) {
            case Icon::cases:
                if (may_leave_attempt(app, "Cases")) {
                    finish_attempt(app);
                    show_bundles(app.player, view);
                }
                break;
            case Icon::target: view.dialog = Dialog::exercises; break;
            case Icon::user: view.dialog = Dialog::sign_in; break;
            case Icon::group: view.page = Page::group; break;
            case Icon::probe: view.show_setup = true; break;
            case Icon::link: view.dialog = Dialog::tracker; break;
            case Icon::timer: view.dialog = Dialog::effects; break;
            case Icon::cube: app.player.settings.show_3d = !app.player.settings.show_3d; break;
            case Icon::warn: view.dialog = Dialog::notices; break;
            case Icon::eye: view.instructor.wanted = !view.instructor.wanted; break;
            case Icon::plus: begin_new_target(app); break;
            default: view.dialog = Dialog::help; break;
        }
    }
    ui.end_layer();
}

void draw_sign_in(App& app, Ui& ui) {
    PlayerState& player = app.player;
    const int names = static_cast<int>(std::min<std::size_t>(player.trainees.size(), 6));
    Box room =
        begin_page_dialog(ui, app, "Sign in", 460, 76 + 52 * static_cast<float>(names + 2) + 30);
    Box line = room.take_top(44, 8);
    Look look;
    look.primary = true;
    const Box add = line.take_right(ui.width(tr("Sign in"), Type::bold) + 28, 8);
    const bool entered =
        ui.input("##name", line, app.view.name, sizeof app.view.name, tr("Add a name"));
    bool done = (ui.button("sign", add, tr("Sign in"), look) || entered) && app.view.name[0];
    if (done) sign_in(app, app.view.name);
    for (int i = 0; i < names; ++i) {
        const std::string& name = player.trainees[static_cast<std::size_t>(i)];
        Look one;
        one.left = true;
        one.icon = Icon::user;
        one.chosen = name == player.trainee;
        if (room.h < 96 || !ui.button(name.c_str(), room.take_top(44, 8), name, one)) continue;
        sign_in(app, name);
        done = true;
    }
    Look none;
    none.left = true;
    none.icon = Icon::close;
    none.chosen = player.trainee.empty();
    none.tip = "Scores are not kept";
    if (ui.button("none", room.take_top(44, 8), tr("No name"), none)) {
        sign_in(app, "");
        done = true;
    }
    ui.text(room.take_top(22), tr("Everything stays on this machine."), Type::small, colour::kDim,
            Align::left, true);
    ui.end_layer();
    if (!done) return;
    app.view.name[0] = 0;
    app.view.dialog = Dialog::none;
}

void draw_tracker(App& app, Ui& ui, const TrackerHealth& health) {
    const CaseState& loaded = app.loaded;
    const TrackerInUse& tracker = app.scan.tracker;
    const Box room = begin_page_dialog(ui, app, "Tracker", 420, 560);
    std::optional<std::string> chosen;
    flow(ui, room, "tracker", [&] {
        chosen = draw_tracker_panel({tracker.spec, loaded.exercise().sweeps, health, loaded.frame(),
                                     app.scan.controls.assignment, loaded.calibrations,
                                     tracker.paced.get()});
    });
    ui.end_layer();
    if (chosen) choose_tracker(app, *chosen);
}

// Newest first.
void draw_notices(App& app, Ui& ui) {
    Box room = begin_page_dialog(ui, app, "Notices", 640, 460);
    const std::vector<Notice>& kept = app.view.notices.kept();
    if (kept.empty())
        ui.paragraph(room, tr("Nothing has been said yet."), Type::body, colour::kDim, true);
    for (auto notice = kept.rbegin(); notice != kept.rend(); ++notice) {
        const std::string words = tr_said(notice->text);
        const float high = ui.paragraph_height(room.w - 100, words, Type::small) + 10;
        if (room.h < high) break;
        Box row = room.take_top(high);
        const bool news = notice->kind == Notice::Kind::news;
        ui.icon(news ? Icon::check : Icon::warn, row.x, row.y + 2, 18,
                news ? colour::kGood : colour::kWarn);
        char ago[32];
        const int seconds = static_cast<int>(app.player.now_s - notice->since_s);
        std::snprintf(ago, sizeof ago, "-%d:%02d", seconds / 60, seconds % 60);
        ui.text({row.right() - 64, row.y, 64, 20}, ago, Type::small, colour::kDim, Align::right,
                true);
        ui.paragraph({row.x + 28, row.y + 2, row.w - 100, high}, words, Type::small, colour::kText,
                     true);
    }
    ui.end_layer();
}

void draw_effects(App& app, Ui& ui) {
    const Box room = begin_page_dialog(ui, app, "Effects", 460, 700);
    flow(ui, room, "effects", [&] { draw_effects_panel(app.loaded.frame(), ui.scale()); });
    ui.end_layer();
}

}  // namespace

void draw_dialogs(App& app, Ui& ui, const TrackerHealth& tracker) {
    const bool open = app.loaded.open != nullptr;
    switch (app.view.dialog) {
        case Dialog::none: break;
        case Dialog::help: draw_help(app, ui); break;
        case Dialog::settings: draw_settings(app, ui); break;
        case Dialog::sign_in: draw_sign_in(app, ui); break;
        case Dialog::exercises:
            if (open) draw_exercises(app, ui);
            break;
        case Dialog::notices: draw_notices(app, ui); break;
        case Dialog::marks:
            if (open) draw_marks(app, ui);
            break;
        case Dialog::label:
            if (open) draw_label(app, ui);
            break;
        case Dialog::tracker:
            if (open) draw_tracker(app, ui, tracker);
            break;
        case Dialog::effects:
            if (open) draw_effects(app, ui);
            break;
        case Dialog::new_target:
            if (open) draw_new_target(app, ui);
            break;
    }
}

}  // namespace sonocase::runtime
