// SPDX-License-Identifier: Apache-2.0

// What is open over the page: help, settings, exercises with their exam set and pass marks, signing
// in, details of tracker and effects, notices, a new target, words on the picture.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <imgui.h>

#include "formats/exercise/metric_table.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/exam_set.h"
#include "runtime/player/app/own_exercises.h"
#include "runtime/player/ui/keys.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {

// A dialog in the middle: its room without heading; closes by its button. end_layer() ends it.
Box begin_page_dialog(Ui& ui, Screen& screen, const char* title, float width, float height);

void draw_effects_panel(const ScanFrame& frame, float s) {
    ImGui::PushFont(fonts().small);
    ImGui::TextUnformatted(filled(tr("%.2f ms per frame"), frame.frame_ms).c_str());
    const Renderer::Accuracy& accuracy = frame.accuracy;
    const std::string lines = filled("%s, %d x %d", tr(accuracy.level == 0 ? "full" : "reduced"),
                                     accuracy.scanlines, accuracy.samples);
    row("Accuracy", lines.c_str(), accuracy.level == 0 ? colour::kText : colour::kWarn);
    ImGui::TextDisabled("%s", tr("Why each is on, and its estimated share of the time, ms"));
    const float right = ImGui::GetWindowContentRegionMax().x;
    for (int i = 0; i < frame.cost_count; ++i) {
        const EffectCost& cost = frame.costs[i];
        const ImVec2 at = ImGui::GetCursorScreenPos();
        const float line = ImGui::GetTextLineHeight();
        if (cost.ran && frame.frame_ms > 0) {
            const float part = static_cast<float>(std::min(cost.ms / frame.frame_ms, 1.0));
            ImGui::GetWindowDrawList()->AddRectFilled(
                at, {at.x + part * ImGui::GetContentRegionAvail().x, at.y + line},
                colour::rgba(72, 186, 214, 46), 2);
        }
        ImGui::PushStyleColor(ImGuiCol_Text, cost.ran ? colour::kText : colour::kFaint);
        ImGui::TextUnformatted(cost.name);
        ImGui::SameLine(140 * s);
        ImGui::TextUnformatted(cost.ran ? tr(cost.why)
                                        : filled(tr("off: %s"), tr(cost.why)).c_str());
        if (cost.ran) {
            const std::string value = filled("%.2f", cost.ms);
            ImGui::SameLine(right - ImGui::CalcTextSize(value.c_str()).x);
            ImGui::TextUnformatted(value.c_str());
        }
        ImGui::PopStyleColor();
    }
    ImGui::PopFont();
}

namespace {

void draw_exam_set(
    const SessionView& session, ViewState& view, Ui& ui, Box row, Requests& requests) {
    const int size = exam_set_size(session.settings, session.loaded);
    ButtonStyle style;
    style.icon = Icon::edit;
    style.tip = "What has to be reached to pass the exercise in use";
    if (ui.button("marks", row.take_left(60 + ui.width(tr("Pass marks"), Type::body), 8),
                  tr("Pass marks"), style))
        begin_marks(session.loaded, view.educator, view.screen);
    style = {};
    style.icon = Icon::lock;
    style.enabled = size > 0 && !session.scan.training.attempt;
    style.tip = "Each marked exercise once, without help";
    if (ui.button("exam_set", row, filled(tr("Start exam set (%d)"), size), style))
        requests.push_back(request::StartExamSet{});
}

void draw_marks(std::vector<Exercise::PassMark>& marks,
                bool attempt_runs,
                Screen& screen,
                Ui& ui,
                Requests& requests) {
    Box room = begin_page_dialog(ui, screen, "Pass marks", 560,
                                 140 + 52 * static_cast<float>(marks.size()));
    const Box foot = room.take_bottom(48);
    for (std::size_t i = 0; i < marks.size() && room.h >= 44; ++i) {
        Exercise::PassMark& mark = marks[i];
        Box row = room.take_top(44, 8);
        const MetricInfo* info = find_metric(mark.metric);
        const Box limit = row.take_right(std::min(264.0f, 0.6f * row.w), 12);
        const char* title = tr(info ? info->title : mark.metric.c_str());
        const float high = std::min(ui.paragraph_height(row.w, title, Type::small), row.h);
        ui.paragraph({row.x, row.y + 0.5f * (row.h - high), row.w, high}, title, Type::small,
                     colour::kText, true);
        const bool most = std::isfinite(mark.at_most);
        const std::string value = std::string(tr(most ? "at most" : "at least")) + " " +
                                  metric_words(mark.metric, most ? mark.at_most : mark.at_least);
        ImGui::PushID(static_cast<int>(i));
        const int step = ui.stepper("limit", limit, "", value, "The pass mark");
        ImGui::PopID();
        if (step != 0) step_mark(mark, step);
    }
    ButtonStyle style;
    style.primary = true;
    style.icon = Icon::save;
    style.enabled = !marks.empty() && !attempt_runs;
    style.tip = "As a TOML file beside the case, in place of the marks of before";
    if (ui.button("save", foot, tr("Save marks"), style)) requests.push_back(request::SaveMarks{});
    ui.end_layer();
}

void draw_exercises(
    const SessionView& session, Settings& settings, ViewState& view, Ui& ui, Requests& requests) {
    Screen& screen = view.screen;
    const CaseState& loaded = session.loaded;
    const std::vector<Exercise>& exercises = loaded.open->exercises;
    const float wanted = 132 + 52 * static_cast<float>(exercises.size());
    Box room = begin_page_dialog(ui, screen, "Exercises", 640, wanted);
    draw_exam_set(session, view, ui, room.take_bottom(48), requests);
    for (std::size_t i = 0; i < exercises.size() && room.h >= 44; ++i) {
        const Exercise& exercise = exercises[i];
        Box row = room.take_top(44, 8);
        ImGui::PushID(static_cast<int>(i));
        ButtonStyle exam;
        exam.icon = Icon::lock;
        exam.chosen = in_exam_set(settings, loaded, exercise.name);
        exam.tip = "Part of this case's exam set";
        if (ui.button("in_exam", row.take_right(44, 8), "", exam))
            toggle_in_exam_set(settings, loaded, exercise.name);
        ButtonStyle style;
        style.left = true;
        style.icon = Icon::target;
        style.chosen = static_cast<int>(i) == loaded.exercise_index;
        style.may_cut = true;
        const std::string title =
            texts_of(*loaded.open, static_cast<int>(i), language_in_use().code).title;
        const bool chosen = ui.button(exercise.name.c_str(), row, title, style);
        ImGui::PopID();
        if (chosen)
            requests.push_back(request::ChooseExercise{
                .index = static_cast<int>(i), .asked_by = "Choosing it", .close_dialog = true});
    }
    ui.end_layer();
}

void draw_new_target(NewTarget& target, Screen& screen, Ui& ui, Requests& requests) {
    Box room = begin_page_dialog(ui, screen, "New target", 460, 260);
    ui.text(room.take_top(24, 4), tr("Name of the exercise"), Type::body, colour::kDim);
    const bool entered = ui.input("##title", room.take_top(44, 8), target.title,
                                  sizeof target.title, tr("For example: Dome lesion"));
    const int step = ui.stepper("radius", room.take_top(44, 8), tr("Radius"),
                                text("%.0f mm", target.radius_mm), "Of the target");
    target.radius_mm = std::clamp(target.radius_mm + step, 2.0, 30.0);
    ButtonStyle style;
    style.primary = true;
    style.icon = Icon::save;
    style.enabled = target.title[0] != 0;
    style.tip = "As a TOML file beside the case; it is among the exercises at once";
    if ((ui.button("save", room.take_top(48), tr("Save exercise"), style) || entered) &&
        target.title[0])
        requests.push_back(request::SaveNewTarget{});
    ui.end_layer();
}

void draw_label(PictureMarks& marks, Screen& screen, Ui& ui) {
    Box room = begin_page_dialog(ui, screen, "Label", 420, 132);
    Box line = room.take_top(44, 8);
    ButtonStyle style;
    style.primary = true;
    const Box put = line.take_right(ui.width(tr("Put"), Type::bold) + 36, 8);
    const bool entered =
        ui.input("##label", line, marks.words, sizeof marks.words, tr("For example: Portal vein"));
    if (ui.button("put", put, tr("Put"), style) || entered) {
        add_label(marks);
        screen.dialog = Dialog::none;
    }
    ui.end_layer();
}

}  // namespace

Box begin_page_dialog(Ui& ui, Screen& screen, const char* title, float width, float height) {
    const Box all = ui.window().inset(8);
    const float w = std::min(width, all.w), h = std::min(height, all.h);
    const Box box{all.x + 0.5f * (all.w - w), all.y + 0.5f * (all.h - h), w, h};
    ui.begin_layer(title, box, true);
    Box room = box.inset(16, 12);
    Box head = room.take_top(44, 8);
    ButtonStyle style;
    style.icon = Icon::close;
    style.ghost = true;
    style.tip = "Close (Esc)";
    if (ui.button("close", head.take_right(44, 8), "", style)) screen.dialog = Dialog::none;
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

void draw_help(Screen& screen, Ui& ui) {
    const Box room = begin_page_dialog(ui, screen, "Help", 900, 780);
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

void choose_size(Window& window, Settings& settings, Ui& ui, Box box) {
    choice_name(ui, box, "Size of words");
    const double asked = window.asked_scale();
    const int step =
        ui.stepper("size", box, "", text("%.0f %%", 100 * asked), "Ctrl + plus and minus");
    if (step == 0) return;
    settings.ui_scale = std::clamp(std::round(asked * 10 + step) / 10, 0.8, 4.0);
    window.set_scale(static_cast<float>(settings.ui_scale));
}

void choose_language(Settings& settings, Ui& ui, Box box) {
    choice_name(ui, box, "Language");
    int i = 0;
    const int count = static_cast<int>(languages().size());
    for (const Language& language : languages()) {
        ButtonStyle style;
        style.chosen = &language == &language_in_use();
        if (ui.button(language.code.c_str(), box.column(i++, count, 8), language.name, style)) {
            settings.language = language.code;
            use_language(language.code);
        }
    }
}

void choose_picture(const ImageChoice& image, Ui& ui, Box box, Requests& requests) {
    choice_name(ui, box, "Picture");
    struct Choice {
        const char *model, *machine, *name, *tip;
    };
    constexpr Choice kChoices[] = {
        {"physical", "", "Modern", "A scanner of today, physically simulated"},
        {"physical", "classic", "Classic", "A scanner of some twenty years ago"},
        {"paper", "", "Simple", "The simple model; fastest"}};
    int i = 0;
    for (const Choice& choice : kChoices) {
        ButtonStyle style;
        style.tip = choice.tip;
        style.chosen = image.model == choice.model &&
                       (image.model == "paper" || image.machine == choice.machine);
        if (!ui.button(choice.name, box.column(i++, 3, 8), tr(choice.name), style)) continue;
        requests.push_back(request::ChooseModel{choice.model, choice.machine});
    }
}

// Everything that can be opened, so that whatever was closed comes back.
// course: there is one to be opened.
void draw_settings(const CaseState& loaded,
                   Settings& settings,
                   bool course,
                   ViewState& view,
                   Ui& ui,
                   Requests& requests) {
    Screen& screen = view.screen;
    const bool scanning = loaded.open && screen.page == Page::scan;
    const bool low = ui.window().h < 480;  // two rows in one, so that no button is left out
    Box room = begin_page_dialog(ui, screen, "Settings", low ? 640.0f : 560.0f,
                                 scanning ? 508.0f
                                 : course ? 362.0f
                                          : 310.0f);
    Box first = room.take_top(44, 8);
    if (low) choose_language(settings, ui, first.take_right(0.47f * first.w, 16));
    choose_size(*view.display.window, settings, ui, first);
    const float used = ui.scale();
    if (used + 0.005f < view.display.window->asked_scale())
        ui.text(room.take_top(20, 8),
                std::string(tr("This size does not fit the window; it is shown at")) +
                    text(" %.0f %%.", 100.0 * used),
                Type::small, colour::kWarn, Align::left, true);
    if (!low) choose_language(settings, ui, room.take_top(44, 8));
    if (scanning) choose_picture(loaded.engine.image, ui, room.take_top(44, 8), requests);
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
        {"Course", Icon::next, false, "Modules in order, each with its gate"},
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
        if (item.icon == Icon::next && (!course || scanning)) continue;
        if (i % columns == 0) row = room.take_top(44, 8);
        ButtonStyle style;
        style.icon = item.icon;
        style.left = true;
        style.tip = item.tip;
        style.chosen = (item.icon == Icon::cube && settings.show_3d) ||
                       (item.icon == Icon::eye && view.display.instructor.wanted);
        if (row.h < 30 ||
            !ui.button(item.words, row.column(i++ % columns, columns, 8), tr(item.words), style))
            continue;
        screen.dialog = Dialog::none;
        switch (item.icon) {
            case Icon::cases: requests.push_back(request::ShowCases{"Cases"}); break;
            case Icon::target: screen.dialog = Dialog::exercises; break;
            case Icon::user: screen.dialog = Dialog::sign_in; break;
            case Icon::group: screen.page = Page::group; break;
            case Icon::next: screen.page = Page::course; break;
            case Icon::probe: screen.show_setup = true; break;
            case Icon::link: screen.dialog = Dialog::tracker; break;
            case Icon::timer: screen.dialog = Dialog::effects; break;
            case Icon::cube: settings.show_3d = !settings.show_3d; break;
            case Icon::warn: screen.dialog = Dialog::notices; break;
            case Icon::eye: view.display.instructor.wanted = !view.display.instructor.wanted; break;
            case Icon::plus: requests.push_back(request::BeginNewTarget{}); break;
            default: screen.dialog = Dialog::help; break;
        }
    }
    ui.end_layer();
}

void draw_sign_in(PlayerState& player, ViewState& view, Ui& ui) {
    Screen& screen = view.screen;
    const int names = static_cast<int>(std::min<std::size_t>(player.progress.trainees.size(), 6));
    Box room =
        begin_page_dialog(ui, screen, "Sign in", 460, 76 + 52 * static_cast<float>(names + 2) + 30);
    Box line = room.take_top(44, 8);
    ButtonStyle style;
    style.primary = true;
    const Box add = line.take_right(ui.width(tr("Sign in"), Type::bold) + 28, 8);
    const bool entered =
        ui.input("##name", line, view.sign_in_name, sizeof view.sign_in_name, tr("Add a name"));
    bool done = (ui.button("sign", add, tr("Sign in"), style) || entered) && view.sign_in_name[0];
    if (done) sign_in(player, view.sign_in_name);
    for (int i = 0; i < names; ++i) {
        const std::string& name = player.progress.trainees[i];
        ButtonStyle one;
        one.left = true;
        one.icon = Icon::user;
        one.chosen = name == player.progress.trainee;
        if (room.h < 96 || !ui.button(name.c_str(), room.take_top(44, 8), name, one)) continue;
        sign_in(player, name);
        done = true;
    }
    ButtonStyle none;
    none.left = true;
    none.icon = Icon::close;
    none.chosen = player.progress.trainee.empty();
    none.tip = "Scores are not kept";
    if (ui.button("none", room.take_top(44, 8), tr("No name"), none)) {
        sign_in(player, "");
        done = true;
    }
    ui.text(room.take_top(22), tr("Everything stays on this machine."), Type::small, colour::kDim,
            Align::left, true);
    ui.end_layer();
    if (!done) return;
    view.sign_in_name[0] = 0;
    screen.dialog = Dialog::none;
}

void draw_tracker(const SessionView& session, Screen& screen, Ui& ui, Requests& requests) {
    const CaseState& loaded = session.loaded;
    const TrackerInUse& tracker = session.scan.tracker;
    const Box room = begin_page_dialog(ui, screen, "Tracker", 420, 560);
    std::optional<std::string> chosen;
    flow(ui, room, "tracker", [&] {
        // Fields and buttons of 44 u, and room between them.
        const float s = ui.scale();
        const float pad = std::max(0.5f * (44 * s - ImGui::GetFontSize()), 0.0f);
        ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {12 * s, pad});
        ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {8 * s, 6 * s});
        chosen = draw_tracker_panel({.spec = tracker.spec,
                                     .sweeps = loaded.exercise().sweeps,
                                     .health = session.tracker,
                                     .frame = loaded.frame(),
                                     .assignment = session.scan.console.controls.assignment,
                                     .calibrations = loaded.set_up.calibrations,
                                     .paced = tracker.paced.get()});
        ImGui::PopStyleVar(2);
    });
    ui.end_layer();
    if (chosen) requests.push_back(request::ChooseTracker{*chosen});
}

// Notices, newest first.
void draw_notices(const Notices& notices, double now_s, Screen& screen, Ui& ui) {
    Box room = begin_page_dialog(ui, screen, "Notices", 640, 460);
    const std::vector<Notice>& kept = notices.kept();
    if (kept.empty())
        ui.paragraph(room, tr("Nothing has been said yet."), Type::body, colour::kDim, true);
    for (auto notice = kept.rbegin(); notice != kept.rend(); ++notice) {
        const std::string words = tr_message(notice->text);
        const float high = ui.paragraph_height(room.w - 100, words, Type::small) + 10;
        if (room.h < high) break;
        Box row = room.take_top(high);
        const bool news = notice->kind == Notice::Kind::news;
        ui.icon(news ? Icon::check : Icon::warn, row.x, row.y + 2, 18,
                news ? colour::kGood : colour::kWarn);
        char ago[32];
        const int seconds = static_cast<int>(now_s - notice->since_s);
        std::snprintf(ago, sizeof ago, "-%d:%02d", seconds / 60, seconds % 60);
        ui.text({row.right() - 64, row.y, 64, 20}, ago, Type::small, colour::kDim, Align::right,
                true);
        ui.paragraph({row.x + 28, row.y + 2, row.w - 100, high}, words, Type::small, colour::kText,
                     true);
    }
    ui.end_layer();
}

void draw_effects(const ScanFrame& frame, Screen& screen, Ui& ui) {
    const Box room = begin_page_dialog(ui, screen, "Effects", 520, 720);
    flow(ui, room, "effects", [&] { draw_effects_panel(frame, ui.scale()); });
    ui.end_layer();
}

}  // namespace

void draw_dialogs(
    const SessionView& session, PlayerState& player, ViewState& view, Ui& ui, Requests& requests) {
    Screen& screen = view.screen;
    switch (screen.dialog) {
        case Dialog::none: return;
        case Dialog::help: draw_help(screen, ui); return;
        case Dialog::settings:
            draw_settings(session.loaded, player.settings, !player.progress.courses.empty(), view,
                          ui, requests);
            return;
        case Dialog::sign_in: draw_sign_in(player, view, ui); return;
        case Dialog::notices: draw_notices(player.notices, player.now_s, screen, ui); return;
        default: break;
    }
    if (!session.case_open()) return;
    switch (screen.dialog) {
        case Dialog::exercises: draw_exercises(session, player.settings, view, ui, requests); break;
        case Dialog::marks:
            draw_marks(view.educator.marks, session.scan.training.attempt != nullptr, screen, ui,
                       requests);
            break;
        case Dialog::label: draw_label(view.tools.marks, screen, ui); break;
        case Dialog::tracker: draw_tracker(session, screen, ui, requests); break;
        case Dialog::effects: draw_effects(session.loaded.frame(), screen, ui); break;
        case Dialog::new_target:
            draw_new_target(view.educator.new_target, screen, ui, requests);
            break;
        default: break;
    }
}

}  // namespace sonocase::runtime::inline player_ui
