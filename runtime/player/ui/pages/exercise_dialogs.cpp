// SPDX-License-Identifier: Apache-2.0

// Over the page: exercises with their exam set, pass marks, a new target, words on the picture.
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/app/educator/exam_set.h"
#include "runtime/player/app/educator/marks.h"
#include "runtime/player/app/educator/new_target.h"
#include "runtime/player/ui/pages/pages.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

void draw_exam_set(App& app, Ui& ui, Box row) {
    const int size = exam_set_size(app);
    Look look;
    look.icon = Icon::edit;
    look.tip = "What has to be reached to pass the exercise in use";
    if (ui.button("marks", row.take_left(60 + ui.width(tr("Pass marks"), Type::body), 8),
                  tr("Pass marks"), look))
        begin_marks(app);
    look = {};
    look.icon = Icon::lock;
    look.enabled = size > 0 && !app.scan.attempt;
    look.tip = "Each marked exercise once, without help";
    char words[64];
    std::snprintf(words, sizeof words, tr("Start exam set (%d)"), size);
    if (ui.button("exam_set", row, words, look)) start_exam_set(app);
}

}  // namespace

void draw_marks(App& app, Ui& ui) {
    auto& marks = app.view.marks;
    Box room =
        begin_page_dialog(ui, app, "Pass marks", 560, 140 + 52 * static_cast<float>(marks.size()));
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
    Look look;
    look.primary = true;
    look.icon = Icon::save;
    look.enabled = !marks.empty() && !app.scan.attempt;
    look.tip = "As a TOML file beside the case, in place of the marks of before";
    if (ui.button("save", foot, tr("Save marks"), look)) save_marks(app);
    ui.end_layer();
}

void draw_exercises(App& app, Ui& ui) {
    const std::vector<Exercise>& exercises = app.loaded.open->exercises;
    const float wanted = 132 + 52 * static_cast<float>(exercises.size());
    Box room = begin_page_dialog(ui, app, "Exercises", 640, wanted);
    draw_exam_set(app, ui, room.take_bottom(48));
    for (std::size_t i = 0; i < exercises.size() && room.h >= 44; ++i) {
        const Exercise& exercise = exercises[i];
        Box row = room.take_top(44, 8);
        ImGui::PushID(static_cast<int>(i));
        Look exam;
        exam.icon = Icon::lock;
        exam.chosen = in_exam_set(app, exercise.name);
        exam.tip = "Part of this case's exam set";
        if (ui.button("in_exam", row.take_right(44, 8), "", exam))
            toggle_in_exam_set(app, exercise.name);
        Look look;
        look.left = true;
        look.icon = Icon::target;
        look.chosen = static_cast<int>(i) == app.loaded.exercise_index;
        look.may_cut = true;
        const std::string title = exercise.title.empty() ? exercise.name : exercise.title;
        const bool chosen = ui.button(exercise.name.c_str(), row, title, look);
        ImGui::PopID();
        if (chosen && may_leave_attempt(app, "Choosing it")) {
            choose_exercise(app, static_cast<int>(i));
            app.view.page = Page::scan;
            app.view.dialog = Dialog::none;
        }
    }
    ui.end_layer();
}

void draw_new_target(App& app, Ui& ui) {
    NewTarget& target = app.view.new_target;
    Box room = begin_page_dialog(ui, app, "New target", 460, 260);
    ui.text(room.take_top(24, 4), tr("Name of the exercise"), Type::body, colour::kDim);
    const bool entered = ui.input("##title", room.take_top(44, 8), target.title,
                                  sizeof target.title, tr("For example: Dome lesion"));
    const int step = ui.stepper("radius", room.take_top(44, 8), tr("Radius"),
                                text("%.0f mm", target.radius_mm), "Of the target");
    target.radius_mm = std::clamp(target.radius_mm + step, 2.0, 30.0);
    Look look;
    look.primary = true;
    look.icon = Icon::save;
    look.enabled = target.title[0] != 0;
    look.tip = "As a TOML file beside the case; it is among the exercises at once";
    if ((ui.button("save", room.take_top(48), tr("Save exercise"), look) || entered) &&
        target.title[0])
        save_new_target(app);
    ui.end_layer();
}

void draw_label(App& app, Ui& ui) {
    PictureMarks& marks = app.view.marks_on_picture;
    Box room = begin_page_dialog(ui, app, "Label", 420, 132);
    Box line = room.take_top(44, 8);
    Look look;
    look.primary = true;
    const Box put = line.take_right(ui.width(tr("Put"), Type::bold) + 36, 8);
    const bool entered =
        ui.input("##label", line, marks.words, sizeof marks.words, tr("For example: Portal vein"));
    if (ui.button("put", put, tr("Put"), look) || entered) {
        add_label(marks);
        app.view.dialog = Dialog::none;
    }
    ui.end_layer();
}

}  // namespace sonocase::runtime
