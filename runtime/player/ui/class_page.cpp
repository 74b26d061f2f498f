// SPDX-License-Identifier: Apache-2.0

// The class: trainees by exercises, who needs help, learning curves; files of all of it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

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
                        : now.mastered    ? "Mastered"
                        : now.passes > 0  ? "Passed"
                                          : "Not yet";
    ui.icon(icon, box.x + 4, box.y + 0.5f * box.h - 9, 18, packed);
    char line[64];
    std::snprintf(line, sizeof line, now.attempts ? "%s · %d" : "%s", tr(words), now.attempts);
    ui.text({box.x + 28, box.y, box.w - 32, box.h}, line, Type::small,
            now.attempts ? colour::kText : colour::kDim, Align::left, true);
}

constexpr float kTableRow = 44, kMinColumn = 116;

// The columns are exercises; where not all fit, arrows go to the others.
void draw_table_head(
    ClassPage& page, Ui& ui, Box head, float name, const ClassRecords& records, int shown) {
    const auto all = static_cast<int>(records.exercises.size());
    int& first = page.first_column;
    first = std::clamp(first, 0, std::max(all - shown, 0));
    Box arrows = head.take_left(name);
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
    for (int i = 0; i < shown; ++i)
        ui.text(head.column(i, shown, 8), records.exercises[first + i], Type::small, colour::kDim,
                Align::left, true);
}

void draw_table(ClassPage& page, Ui& ui, const Box& card, const ClassRecords& records) {
    ui.card(card, "table");
    Box room = card.inset(16, 12);
    const float name = std::clamp(0.3f * room.w, 110.0f, 220.0f);
    const auto all = static_cast<int>(records.exercises.size());
    const int shown = std::clamp(static_cast<int>((room.w - name) / kMinColumn), 1, all);
    draw_table_head(page, ui, room.take_top(kTableRow), name, records, shown);
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
        for (int i = 0; i < shown; ++i) {
            const int column = page.first_column + i;
            draw_cell(ui, row.column(i, shown, 8),
                      records.standing(trainee, records.exercises[column]));
        }
    }
    ui.unclip();
}

// Tip to target over attempts: everyone grey, the chosen one in the accent colour.
void draw_curves(const std::string& chosen_trainee,
                 Ui& ui,
                 const Box& card,
                 const ClassRecords& records) {
    ui.card(card, "curves");
    Box room = card.inset(16, 12);
    ui.text(room.take_top(24), tr("Tip to target over attempts, mm"), Type::bold, colour::kText,
            Align::left, true);
    Box plot = room.inset(8, 14);
    double max_mm = 1;
    std::size_t longest = 2;
    for (const auto& [trainee, curve] : records.curves) {
        longest = std::max(longest, curve.size());
        for (const double mm : curve) max_mm = std::max(max_mm, mm);
    }
    ui.line(plot.x, plot.bottom(), plot.right(), plot.bottom(), colour::kLine);
    ui.text({plot.x, plot.y - 16, 80, 18}, text("%.0f mm", max_mm), Type::small, colour::kDim);
    for (const bool chosen : {false, true}) {
        for (const auto& [trainee, curve] : records.curves) {
            if ((trainee == chosen_trainee) != chosen) continue;
            std::vector<float> xy;
            for (std::size_t i = 0; i < curve.size(); ++i) {
                xy.push_back(plot.x +
                             plot.w * static_cast<float>(i) / static_cast<float>(longest - 1));
                xy.push_back(plot.bottom() - plot.h * static_cast<float>(curve[i] / max_mm));
            }
            ui.curve(xy, chosen ? colour::kAccent : colour::kEdge, chosen ? 2.5f : 1.0f);
            for (std::size_t i = 0; i + 1 < xy.size(); i += 2)
                ui.disc(xy[i], xy[i + 1], chosen ? 4.0f : 2.0f,
                        chosen ? colour::kAccent : colour::kEdge);
        }
    }
}

// Alpha and the pass mark of each exercise, with what they rest on.
void draw_reliability(Ui& ui, const Box& card, const ClassRecords& records) {
    ui.card(card, "reliability");
    Box room = card.inset(16, 12);
    ui.text(room.take_top(24), tr("Reliability"), Type::bold, colour::kText, Align::left, true);
    const char* what =
        tr("Alpha over 3 attempts (0.8 is usual where marks decide); pass mark where experts "
           "and first attempts cross");
    const float high = std::min(ui.paragraph_height(room.w, what, Type::small), 54.0f);
    ui.paragraph(room.take_top(high, 6), what, Type::small, colour::kDim, true);
    for (const std::string& exercise : records.exercises) {
        if (room.h < 28) return;
        const Box row = room.take_top(28);
        const auto found = records.reliability.find(exercise);
        if (found == records.reliability.end()) continue;
        const ExerciseReliability& r = found->second;
        char words[160], alpha[48] = "–", mark[80] = "–";
        if (std::isfinite(r.alpha))
            std::snprintf(alpha, sizeof alpha, "%.2f (%d)", r.alpha, r.trainees);
        if (std::isfinite(r.groups.mark))
            std::snprintf(mark, sizeof mark, "%.1f mm (%d, %d)", r.groups.mark, r.groups.experts,
                          r.groups.novices);
        std::snprintf(words, sizeof words, "%s %s   %s %s", tr("alpha"), alpha, tr("pass mark"),
                      mark);
        ui.text({row.x, row.y, 0.4f * row.w, row.h}, exercise, Type::small, colour::kDim,
                Align::left, true);
        ui.text({row.x + 0.4f * row.w, row.y, 0.6f * row.w, row.h}, words, Type::small,
                colour::kText, Align::right, true);
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
    if (page.trainee.empty()) return;
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
        std::string(tr(asked ? "Really remove" : "Remove")) + " " + page.trainee;
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

}  // namespace

void draw_class_page(PlayerState& player, ClassPage& page, Screen& screen, Ui& ui) {
    const Box window = ui.window();
    const PageLayout layout = page_layout(window.w, window.h);
    Box bar = layout.bar;
    if (back_button(ui, bar, "cases", tr("Cases"), "Back to all cases"))
        screen.page = Page::bundles;
    if (!show_notice(player.notices, ui, bar)) ui.text(bar, tr("Class"), Type::heading);
    const ClassRecords& records = class_records(player);
    Box content = layout.content;
    if (records.trainees.empty()) {
        ui.paragraph(content,
                     tr("Nobody has signed in yet. Attempts of trainees with a name appear here."),
                     Type::body, colour::kDim);
        return;
    }
    const Box files = content.take_bottom(48, 12);
    if (!records.sentence.empty())
        ui.text(content.take_top(32, 4), records.sentence, Type::body, colour::kText, Align::left,
                true);
    if (layout.columns >= 3) {
        Box side = content.take_right(0.34f * content.w, 16);
        if (side.h > 420)
            draw_reliability(ui, side.take_bottom(std::min(0.4f * side.h, 260.0f), 12), records);
        draw_curves(page.trainee, ui, side, records);
    } else if (content.h > 420) {
        draw_curves(page.trainee, ui, content.take_bottom(200, 12), records);
    }
    draw_table(page, ui, content, records);
    draw_files(player, page, ui, files);  // last: it may let go of the records
}

}  // namespace sonocase::runtime::inline player_ui
