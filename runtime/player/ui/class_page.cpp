// SPDX-License-Identifier: Apache-2.0

// The class: trainees by exercises, who needs help, learning curves; files of all of it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "formats/scoring/course_standing.h"
#include "runtime/player/app/class_steps.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

void draw_cell(Ui& ui, const Box& box, const Standing& now) {
    const Icon icon = now.attempts == 0 ? Icon::minus : now.passes > 0 ? Icon::pass : Icon::fail;
    const unsigned packed = now.attempts == 0 ? colour::kDim
                            : now.passes > 0  ? colour::kGood
                                              : colour::kBad;
    const char* words = now.attempts == 0 ? "Not tried"
                        : now.steady      ? "Steady"
                        : now.mastered    ? "Mastered"
                        : now.passes > 0  ? "Passed"
                                          : "Not yet";
    ui.icon(icon, box.x + 4, box.y + 0.5f * box.h - 9, 18, packed);
    const std::string line = now.attempts ? filled("%s · %d", tr(words), now.attempts) : tr(words);
    ui.text({box.x + 28, box.y, box.w - 32, box.h}, line, Type::small,
            now.attempts ? colour::kText : colour::kDim, Align::left, true);
}

constexpr float kTableRow = 44, kHeadRow = 44, kMinColumn = 132, kCourseColumn = 112;

// The title of an exercise, where its case is among those of the start page, and the case's.
struct ExerciseTitle {
    std::string exercise, of_case;
};
ExerciseTitle title_of(const ClassExercise& exercise, const BundleChooser& chooser) {
    for (const BundleEntry& entry : chooser.bundles) {
        const auto card = chooser.cards ? chooser.cards->find(entry.path) : nullptr;
        if (!card || card->case_name != exercise.case_name) continue;
        for (const CaseCard::Exercise& one : card->exercises)
            if (one.name == exercise.name) return {title_of(one), card->title};
        return {exercise.name, card->title};
    }
    return {exercise.name, exercise.case_name};
}

// The title of an item, where its case is among those of the start page.
std::string item_title(const std::string& name,
                       const ClassExercise& exercise,
                       const BundleChooser& chooser) {
    for (const BundleEntry& entry : chooser.bundles) {
        const auto card = chooser.cards ? chooser.cards->find(entry.path) : nullptr;
        if (!card || card->case_name != exercise.case_name) continue;
        for (const CaseCard::Exercise& one : card->exercises)
            for (const CaseCard::Exercise::Item& item : one.items)
                if (one.name == exercise.name && item.name == name) return title_of(item);
    }
    return name;
}

// The columns are exercises; where not all fit, arrows go to the others.
void draw_table_head(ClassPage& page,
                     const BundleChooser& chooser,
                     Ui& ui,
                     Box head,
                     float name,
                     float of_course,
                     const ClassRecords& records,
                     int shown) {
    const auto all = static_cast<int>(records.exercises.size());
    int& first = page.first_column;
    first = std::clamp(first, 0, std::max(all - shown, 0));
    Box arrows = head.take_left(name);
    head.take_left(of_course);
    if (all > shown) {
        ButtonStyle style;
        style.ghost = true;
        style.icon = Icon::back;
        style.tip = "Exercises before these";
        style.enabled = first > 0;
        if (ui.button("earlier", arrows.take_left(44, 4), "", style)) first -= shown;
        style.icon = Icon::next;
        style.tip = "More exercises";
        style.enabled = first + shown < all;
        if (ui.button("later", arrows.take_left(44, 4), "", style)) first += shown;
        first = std::clamp(first, 0, all - shown);
    }
    for (int i = 0; i < shown; ++i) {
        const int at = first + i;
        const Box box = head.column(i, shown, 8);
        const ExerciseTitle title =
            title_of(records.exercises[static_cast<std::size_t>(at)], chooser);
        ButtonStyle style;
        style.ghost = true;
        style.tip = "Learning curves of this exercise";
        char id[32];
        std::snprintf(id, sizeof id, "column%d", at);
        if (ui.button(id, box, "", style)) page.exercise = at;
        ui.begin_in_control();
        const bool chosen = page.exercise == at;
        if (chosen) ui.fill({box.x, box.bottom() - 3, box.w, 3}, colour::kAccent, 1.5f);
        ui.text({box.x + 4, box.y + 1, box.w - 8, 20}, title.exercise, Type::small,
                chosen ? colour::kText : colour::kDim, Align::left, true);
        ui.text({box.x + 4, box.y + 20, box.w - 8, 20}, title.of_case, Type::small, colour::kDim,
                Align::left, true);
        ui.end_in_control();
    }
}

void draw_table(ClassPage& page,
                const BundleChooser& chooser,
                Ui& ui,
                const Box& card,
                const ClassRecords& records) {
    ui.card(card, "table");
    Box room = card.inset(16, 12);
    const float name = std::clamp(0.3f * room.w, 110.0f, 220.0f);
    const auto all = static_cast<int>(records.exercises.size());
    const float of_course = records.course.empty() ? 0 : kCourseColumn;
    const int shown =
        std::clamp(static_cast<int>((room.w - name - of_course) / kMinColumn), 1, all);
    Box head = room.take_top(kHeadRow);
    if (of_course > 0)
        ui.text({head.x + name + 4, head.y + 1, of_course - 8, 20}, tr("Course"), Type::small,
                colour::kDim, Align::left, true);
    draw_table_head(page, chooser, ui, head, name, of_course, records, shown);
    ui.clip(room);
    const double over = kTableRow * static_cast<double>(records.trainees.size()) - room.h;
    ui.scroll_by_wheel(room, page.scroll, std::max(over, 0.0));
    float y = room.y - static_cast<float>(page.scroll);
    for (const std::string& trainee : records.trainees) {
        Box row{room.x, y, room.w - (over > 0 ? 12 : 0), kTableRow};
        y += kTableRow;
        if (row.bottom() <= room.y || row.y >= room.bottom()) continue;
        ui.line(row.x, row.y, row.right(), row.y, colour::kLine);
        ButtonStyle style;
        style.ghost = true;
        style.left = true;
        style.may_cut = true;
        style.chosen = page.trainee == trainee;
        style.tip = "This trainee's learning curve";
        if (ui.button(trainee.c_str(), row.take_left(name - 8, 8).inset(0, 2), trainee, style))
            page.trainee = trainee;
        if (const auto found = records.course.find(trainee); found != records.course.end()) {
            const CourseStanding& now = found->second;
            const Box box = row.take_left(of_course);
            const auto modules = static_cast<int>(now.modules.size());
            std::string words = filled(tr("%d of %d"), now.passed, modules);
            if (now.due > 0) words += " · " + filled(tr("due: %d"), now.due);
            ui.text({box.x + 4, box.y, box.w - 8, box.h}, words, Type::small,
                    now.due > 0 ? colour::kWarn : colour::kText, Align::left, true);
        }
        for (int i = 0; i < shown; ++i) {
            const int column = page.first_column + i;
            draw_cell(ui, row.column(i, shown, 8),
                      records.standing(trainee, records.exercises[column]));
        }
    }
    ui.unclip();
}

// Tip to target over attempts at the chosen exercise: everyone grey, the chosen trainee in the
// accent colour and named.
void draw_curves(const ClassPage& page,
                 const BundleChooser& chooser,
                 Ui& ui,
                 const Box& card,
                 const ClassRecords& records) {
    ui.card(card, "curves");
    Box room = card.inset(16, 12);
    const auto at = std::min(static_cast<std::size_t>(page.exercise), records.exercises.size() - 1);
    const ClassExercise& exercise = records.exercises[at];
    ui.text(room.take_top(24), title_of(exercise, chooser).exercise, Type::bold, colour::kText,
            Align::left, true);
    ui.text(room.take_top(20, 6), tr("Tip to target over attempts, mm"), Type::small, colour::kDim,
            Align::left, true);
    if (room.h < 60) return;
    // Room for the figures of both axes.
    const Box plot{room.x + 34, room.y + 8, room.w - 50, room.h - 32};
    double max_mm = 10;
    std::size_t longest = 2;
    std::vector<std::pair<std::string, std::vector<double>>> curves;
    for (const std::string& trainee : records.trainees) {
        curves.emplace_back(trainee, records.curve(trainee, exercise));
        longest = std::max(longest, curves.back().second.size());
        for (const double mm : curves.back().second) max_mm = std::max(max_mm, mm);
    }
    max_mm = 10 * std::ceil(max_mm / 10);  // its half has no fraction
    const auto x_of = [&](std::size_t i) {
        return plot.x + plot.w * static_cast<float>(i) / static_cast<float>(longest - 1);
    };
    const auto y_of = [&](double mm) {
        return plot.bottom() - plot.h * static_cast<float>(mm / max_mm);
    };
    ui.line(plot.x, plot.bottom(), plot.right(), plot.bottom(), colour::kEdge);
    ui.line(plot.x, plot.y, plot.x, plot.bottom(), colour::kEdge);
    for (const double mm : {0.0, 0.5 * max_mm, max_mm}) {
        ui.line(plot.x - 4, y_of(mm), plot.x, y_of(mm), colour::kEdge);
        ui.text({room.x, y_of(mm) - 9, 28, 18}, text("%.0f", mm), Type::small, colour::kDim,
                Align::right, true);
    }
    const std::size_t step = (longest + 7) / 8;
    for (std::size_t i = 0; i < longest; i += step)
        ui.text({x_of(i) - 14, plot.bottom() + 2, 28, 18}, std::to_string(i + 1), Type::small,
                colour::kDim, Align::centre, true);
    for (const bool chosen : {false, true}) {
        for (const auto& [trainee, curve] : curves) {
            if ((trainee == page.trainee) != chosen || curve.empty()) continue;
            std::vector<float> xy;
            for (std::size_t i = 0; i < curve.size(); ++i) {
                xy.push_back(x_of(i));
                xy.push_back(y_of(curve[i]));
            }
            ui.curve(xy, chosen ? colour::kAccent : colour::kEdge, chosen ? 2.5f : 1.0f);
            for (std::size_t i = 0; i + 1 < xy.size(); i += 2)
                ui.disc(xy[i], xy[i + 1], chosen ? 4.0f : 2.0f,
                        chosen ? colour::kAccent : colour::kEdge);
            if (chosen)
                ui.text({plot.x + 6, plot.y - 6, plot.w - 6, 18}, trainee, Type::small,
                        colour::kAccent, Align::right, true);
        }
    }
}

// Alpha and the pass mark of each exercise, with what they rest on.
void draw_reliability(const BundleChooser& chooser,
                      Ui& ui,
                      const Box& card,
                      const ClassRecords& records) {
    ui.card(card, "reliability");
    Box room = card.inset(16, 12);
    ui.text(room.take_top(24), tr("Reliability"), Type::bold, colour::kText, Align::left, true);
    const char* what =
        tr("Alpha over 3 attempts (0.8 is usual where marks decide); pass mark where experts "
           "and first attempts cross");
    const float high = std::min(ui.paragraph_height(room.w, what, Type::small), 54.0f);
    ui.paragraph(room.take_top(high, 6), what, Type::small, colour::kDim, true);
    for (const ClassExercise& exercise : records.exercises) {
        if (room.h < 28) return;
        const Box row = room.take_top(28);
        const auto found = records.reliability.find(exercise);
        if (found == records.reliability.end()) continue;
        const ExerciseReliability& r = found->second;
        const std::string alpha =
            std::isfinite(r.alpha) ? filled("%.2f (%d)", r.alpha, r.trainees) : "–";
        const std::string mark =
            std::isfinite(r.groups.mark)
                ? filled("%.1f mm (%d, %d)", r.groups.mark, r.groups.experts, r.groups.novices)
                : "–";
        const std::string words =
            tr("alpha") + (" " + alpha + "   ") + tr("pass mark") + " " + mark;
        ui.text({row.x, row.y, 0.4f * row.w, row.h}, title_of(exercise, chooser).exercise,
                Type::small, colour::kDim, Align::left, true);
        ui.text({row.x + 0.4f * row.w, row.y, 0.6f * row.w, row.h}, words, Type::small,
                colour::kText, Align::right, true);
    }
}

// The checklist of the chosen exercise: how often each item was ticked, by the chosen trainee or by
// everyone.
void draw_checklist(const std::vector<ChecklistRow>& rows,
                    const ClassPage& page,
                    const ClassExercise& exercise,
                    const BundleChooser& chooser,
                    Ui& ui,
                    const Box& card) {
    ui.card(card, "checklist");
    Box room = card.inset(16, 12);
    const std::string who = page.trainee.empty() ? std::string(tr("everyone")) : page.trainee;
    ui.text(room.take_top(24), std::string(tr("Checklist")) + " · " + who, Type::bold,
            colour::kText, Align::left, true);
    for (const ChecklistRow& row : rows) {
        if (room.h < 24) return;
        const Box line = room.take_top(24);
        const bool always = row.ticked == row.attempts;
        ui.icon(row.last ? Icon::pass : Icon::fail, line.x, line.y + 3, 16,
                row.last ? colour::kGood : colour::kBad);
        ui.text({line.x + 24, line.y, line.w - 80, line.h}, item_title(row.name, exercise, chooser),
                row.critical ? Type::bold : Type::small, colour::kText, Align::left, true);
        ui.text({line.right() - 56, line.y, 56, line.h},
                filled("%d / %d", row.ticked, row.attempts), Type::small,
                always ? colour::kGood : colour::kWarn, Align::right, true);
    }
}

void draw_files(PlayerState& player, ClassPage& page, Ui& ui, Box row) {
    const struct {
        const char *id, *words, *tip;
        Icon icon;
    } kFiles[] = {{"csv", "CSV", "One row per attempt, for a spreadsheet", Icon::save},
                  {"xapi", "xAPI", "File for a learning record store", Icon::save}};
    for (const auto& file : kFiles) {
        ButtonStyle style;
        style.icon = file.icon;
        style.tip = file.tip;
        if (ui.button(file.id, row.take_left(60 + ui.width(file.words, Type::body), 8), file.words,
                      style))
            save_class_file(player, file.id);
    }
    if (page.trainee.empty()) {
        ui.text(row, tr("Choose a trainee in the table"), Type::small, colour::kDim, Align::right,
                true);
        return;
    }
    ButtonStyle expert;
    expert.icon = Icon::user;
    expert.tip = "This trainee's results set the pass mark";
    expert.chosen = is_expert(player.settings, page.trainee);
    const float expert_width = 60 + ui.width(tr("Expert"), Type::bold);
    if (ui.button("expert", row.take_left(expert_width, 8), tr("Expert"), expert))
        toggle_expert(player, page.trainee);
    ButtonStyle style;
    style.icon = Icon::close;
    style.tip = "Removes this trainee's attempts and recordings from this machine";
    const bool asked = player.now_s - page.remove_asked_s < 5;
    const std::string words =
        filled(tr(asked ? "Really remove %s?" : "Remove %s"), page.trainee.c_str());
    const float wide = 60 + ui.width(words, Type::body);
    if (wide < row.w && ui.button("remove", row.take_right(wide), words, style)) {
        if (asked) {
            remove_from_class(player, page.trainee);
            page.trainee.clear();
        } else {
            page.remove_asked_s = player.now_s;
        }
    }
}

// What an educator makes, of the case that is open.
void draw_actions(bool case_open, Screen& screen, Ui& ui, Box& bar, Requests& requests) {
    const auto button = [&](const char* id, const char* words, Icon icon, const char* tip) {
        ButtonStyle style;
        style.icon = icon;
        style.enabled = case_open;
        style.tip = case_open ? tip : "Open a case first";
        const float wide = 56 + ui.width(tr(words), Type::body);
        return wide < 0.4f * bar.w &&
               ui.button(id, bar.take_right(wide, 8).inset(0, 6), tr(words), style);
    };
    if (button("new_exercise", "New exercise", Icon::plus,
               "A target of your own, placed in the picture of the case that is open")) {
        screen.page = Page::scan;
        requests.push_back(request::BeginNewTarget{});
    }
    if (button("exam_set", "Exam set and marks", Icon::lock,
               "Which exercises an exam asks for, and what has to be reached")) {
        screen.page = Page::scan;
        screen.dialog = Dialog::exercises;
    }
}

}  // namespace

void draw_class_page(PlayerState& player,
                     ClassPage& page,
                     const BundleChooser& chooser,
                     bool case_open,
                     Screen& screen,
                     Ui& ui,
                     Requests& requests) {
    const Box window = ui.window();
    const PageLayout layout = page_layout(window.w, window.h);
    Box bar = layout.bar;
    if (back_button(ui, bar, "cases", tr("Cases"), "Back to all cases"))
        screen.page = Page::bundles;
    if (layout.columns > 1) draw_actions(case_open, screen, ui, bar, requests);
    if (!show_notice(player.notices, ui, bar))
        ui.text(bar, tr("Class"), Type::heading, colour::kText, Align::left, true);
    const ClassRecords& records = class_records(player);
    Box content = layout.content;
    if (records.trainees.empty()) {
        ui.paragraph(content,
                     tr("Nobody has signed in yet. Attempts of trainees with a name appear here."),
                     Type::body, colour::kDim);
        return;
    }
    const Box files = content.take_bottom(48, 12);
    if (const NeedsHelp& help = records.help; !help.trainee.empty()) {
        const std::string words =
            filled(tr("%s may need help with %s: %d attempts, no pass."), help.trainee.c_str(),
                   title_of(help.exercise, chooser).exercise.c_str(), help.attempts);
        Box line = content.take_top(32, 4);
        ui.icon(Icon::warn, line.x, line.y + 7, 18, colour::kWarn);
        line.take_left(26);
        ui.text(line, words, Type::body, colour::kText, Align::left, true);
    }
    if (layout.columns >= 3) {
        Box side = content.take_right(0.34f * content.w, 16);
        const auto at =
            std::min(static_cast<std::size_t>(page.exercise), records.exercises.size() - 1);
        const ClassExercise& exercise = records.exercises[at];
        const std::vector<ChecklistRow> rows = records.checklist(page.trainee, exercise);
        if (side.h > 420 && !rows.empty()) {
            const float high = 48 + 24 * static_cast<float>(rows.size());
            draw_checklist(rows, page, exercise, chooser, ui,
                           side.take_bottom(std::min(0.58f * side.h, high), 12));
        } else if (side.h > 420) {
            draw_reliability(chooser, ui, side.take_bottom(std::min(0.4f * side.h, 260.0f), 12),
                             records);
        }
        draw_curves(page, chooser, ui, side, records);
    } else if (content.h > 420) {
        draw_curves(page, chooser, ui, content.take_bottom(200, 12), records);
    }
    draw_table(page, chooser, ui, content, records);
    draw_files(player, page, ui, files);  // last: it may let go of the records
}

}  // namespace sonocase::runtime::inline player_ui
