// SPDX-License-Identifier: Apache-2.0

// A course: its modules on the left, and of the one that is chosen the question, the text, what to
// practise, the gate and the ways into it.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/course_standing.h"
#include "runtime/player/session/clock.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

constexpr float kRow = 52;

// Where a module takes place: the bundle and the exercise's title. Empty path: no bundle here has
// it.
struct Place {
    std::string path, case_title, exercise_title;
    bool reading = false;  // some cards are still being read
};

Place place_of(const CourseModule& module, const BundleChooser& chooser) {
    Place place;
    for (const BundleEntry& entry : chooser.bundles) {
        const auto card = chooser.cards ? chooser.cards->find(entry.path) : nullptr;
        if (!card) place.reading = true;
        if (!card || card->case_name != module.case_name) continue;
        for (const CaseCard::Exercise& exercise : card->exercises) {
            if (exercise.name != module.exercise) continue;
            return {entry.path, card->title, title_of(exercise), false};
        }
    }
    return place;
}

struct ModuleWords {
    std::string words;
    Icon icon = Icon::target;
    unsigned packed = colour::kDim;
};

ModuleWords words_of(const ModuleStanding& now) {
    if (now.due) return {tr("Due again"), Icon::timer, colour::kWarn};
    if (now.passed) return {tr("Passed"), Icon::pass, colour::kGood};
    if (!now.open) return {tr("Locked"), Icon::lock, colour::kDim};
    if (now.attempts.attempts > 0)
        return {filled(tr("Attempts: %d"), now.attempts.attempts), Icon::target, colour::kAccent};
    return {tr("Not tried"), Icon::target, colour::kAccent};
}

void draw_modules(const Course& course,
                  const CourseStanding& standing,
                  int shown,
                  CoursePage& page,
                  Ui& ui,
                  const Box& card) {
    ui.card(card, "modules");
    const Box room = card.inset(12);
    ui.clip(room);
    const double over = kRow * static_cast<double>(course.modules.size()) - room.h;
    ui.scroll_by_wheel(room, page.scroll_list, std::max(over, 0.0));
    float y = room.y - static_cast<float>(page.scroll_list);
    for (std::size_t i = 0; i < course.modules.size(); ++i) {
        const Box row{room.x, y, room.w - (over > 0 ? 12 : 0), kRow};
        y += kRow;
        if (row.bottom() <= room.y || row.y >= room.bottom()) continue;
        const ModuleWords now = words_of(standing.modules[i]);
        ButtonStyle style;
        style.ghost = true;
        style.chosen = static_cast<int>(i) == shown;
        if (ui.button(("module_" + course.modules[i].name).c_str(), row.inset(0, 2), "", style)) {
            page.module = static_cast<int>(i);
            page.scroll = 0;
        }
        ui.begin_in_control();
        ui.icon(now.icon, row.x + 8, row.y + 16, 20, now.packed);
        ui.text({row.x + 38, row.y + 4, row.w - 46, 24},
                std::to_string(i + 1) + "  " + course.modules[i].title, Type::body, colour::kText,
                Align::left, true);
        ui.text({row.x + 38, row.y + 26, row.w - 46, 20}, now.words, Type::small, colour::kDim,
                Align::left, true);
        ui.end_in_control();
    }
    ui.unclip();
}

// One of the facts below the text: an icon, a line, and a smaller one below it.
void draw_fact(Ui& ui,
               Box& room,
               Icon icon,
               unsigned packed,
               const std::string& words,
               const std::string& below) {
    const Box row = room.take_top(46);
    ui.icon(icon, row.x, row.y + 4, 20, packed);
    ui.text({row.x + 30, row.y, row.w - 30, 24}, words, Type::body, colour::kText, Align::left,
            true);
    ui.text({row.x + 30, row.y + 23, row.w - 30, 20}, below, Type::small, colour::kDim, Align::left,
            true);
}

// Question and options; what was chosen is marked, with why. Returns the option that was pressed.
int draw_question(
    Ui& ui, Box& room, const Box& inside, const CourseModule& module, const ModuleStanding& now) {
    int pressed = -1;
    ui.text(room.take_top(22), tr("Before you read"), Type::small, colour::kDim);
    room.take_top(ui.paragraph({room.x, room.y, room.w, 200}, module.question, Type::bold,
                               colour::kText, true),
                  6);
    for (std::size_t i = 0; i < module.options.size(); ++i) {
        const Box row = room.take_top(40, 4);
        const int option = static_cast<int>(i);
        if (now.option < 0) {
            ButtonStyle style;
            style.left = true;
            style.may_cut = true;
            const bool seen = row.y > inside.y - 1 && row.bottom() < inside.bottom() + 1;
            if (seen &&
                ui.button(("option" + std::to_string(i)).c_str(), row, module.options[i], style))
                pressed = option;
            continue;
        }
        const bool right = option == module.answer, chosen = option == now.option;
        if (right || chosen)
            ui.icon(right ? Icon::pass : Icon::fail, row.x + 4, row.y + 10, 20,
                    right ? colour::kGood : colour::kBad);
        ui.text({row.x + 34, row.y, row.w - 34, row.h}, module.options[i],
                chosen ? Type::bold : Type::body, chosen || right ? colour::kText : colour::kDim,
                Align::left, true);
    }
    if (now.option >= 0 && !module.because.empty())
        room.take_top(ui.paragraph({room.x, room.y, room.w, 200}, module.because, Type::body,
                                   colour::kText, true),
                      10);
    return pressed;
}

std::string gate_words(const CourseGate& gate) {
    const std::string how = tr(gate.exam ? "as an exam" : "as hard as written");
    if (gate.passes_in_a_row > 0 && gate.steady)
        return filled(tr("Gate: %d passes in a row, or steady by CUSUM; %s"), gate.passes_in_a_row,
                      how.c_str());
    if (gate.steady) return filled(tr("Gate: steady by CUSUM; %s"), how.c_str());
    return filled(tr("Gate: passes in a row: %d; %s"), gate.passes_in_a_row, how.c_str());
}

void draw_facts(Ui& ui, Box& room, const CourseModule& module, const ModuleStanding& now) {
    if (const MetricInfo* info = find_metric(module.measure)) {
        const bool least = std::isfinite(module.at_least);
        const std::string limit =
            filled(tr(least ? "at least %s" : "at most %s"),
                   metric_words(module.measure, least ? module.at_least : module.at_most).c_str());
        const std::string last =
            filled(tr("Last: %s"), metric_words(module.measure, now.measured).c_str());
        draw_fact(ui, room, now.in_limits ? Icon::pass : Icon::target,
                  now.in_limits ? colour::kGood : colour::kAccent,
                  std::string(tr("Practise")) + ": " + tr(info->title), limit + " · " + last);
    }
    std::string stands = filled(tr("Passes in a row: %d"), now.attempts.in_a_row);
    if (module.gate.steady)
        stands += text(" · CUSUM %.1f", now.attempts.cusum) + text(" / %.0f", kSteadyCusum);
    if (now.passed) stands = filled(tr("Passed on %s"), now.passed_on.c_str());
    draw_fact(ui, room, now.passed ? Icon::pass : Icon::lock,
              now.passed ? colour::kGood : colour::kAccent, gate_words(module.gate), stands);
    if (module.retention_days == 0) return;
    const std::string when = now.due                ? filled(tr("Due since %s"), now.due_on.c_str())
                             : !now.kept_on.empty() ? filled(tr("Kept: %s"), now.kept_on.c_str())
                             : now.passed           ? filled(tr("Due on %s"), now.due_on.c_str())
                                                    : std::string(tr("Counts from the pass"));
    draw_fact(ui, room, Icon::timer, now.due ? colour::kWarn : colour::kDim,
              filled(tr("Asked for again after days: %d"), module.retention_days), when);
}

request::OpenCase open_module(const CourseModule& module, const Place& place, bool expert) {
    using Then = request::OpenCase::Then;
    return {.path = place.path,
            .exercise = module.exercise,
            .then = expert             ? Then::expert
                    : module.gate.exam ? Then::exam
                                       : Then::practise,
            .sweep = module.expert,
            .in_course = true};
}

void draw_module(const Course& course,
                 const CourseStanding& standing,
                 int shown,
                 CoursePage& page,
                 const BundleChooser& chooser,
                 Ui& ui,
                 const Box& card,
                 Requests& requests) {
    const CourseModule& module = course.modules[static_cast<std::size_t>(shown)];
    const ModuleStanding& now = standing.modules[static_cast<std::size_t>(shown)];
    const Place place = place_of(module, chooser);
    ui.card(card, "module");
    Box whole = card.inset(20, 14);
    Box foot = whole.take_bottom(48, 8);
    std::string line;
    if (!now.open)
        line = filled(
            tr("Locked until this is passed: %s"),
            course.modules[static_cast<std::size_t>(std::max(standing.next, 0))].title.c_str());
    else if (place.path.empty() && !place.reading)
        line = filled(tr("This module needs the case %s, which is not here."),
                      module.case_name.c_str());
    else if (!place.path.empty())
        line = place.exercise_title + " · " + place.case_title;
    const bool ready = now.open && !place.path.empty();
    ui.text(whole.take_bottom(24, 4), line, Type::small, ready ? colour::kDim : colour::kWarn,
            Align::left, true);
    Box room = whole;
    ui.clip(whole);
    room.y -= static_cast<float>(page.scroll);
    room.h = 1e4f;
    room.w -= 12;
    const float top = room.y;
    ui.text(room.take_top(20),
            filled(tr("Module %d of %d"), shown + 1, static_cast<int>(course.modules.size())),
            Type::small, colour::kDim);
    ui.text(room.take_top(34, 6), module.title, Type::large, colour::kText, Align::left, true);
    const bool asks = !module.question.empty();
    if (asks) {
        const int option = draw_question(ui, room, whole, module, now);
        if (option >= 0) requests.push_back(request::AnswerCourse{module.name, option});
    }
    if (!asks || now.option >= 0) {
        room.take_top(ui.paragraph({room.x, room.y, room.w, 900}, module.text, Type::body,
                                   colour::kText, true),
                      12);
    } else {
        ui.text(room.take_top(28, 8), tr("The text follows your answer."), Type::small,
                colour::kDim, Align::left, true);
    }
    draw_facts(ui, room, module, now);
    ui.unclip();
    ui.scroll_by_wheel(whole, page.scroll, std::max(0.0f, room.y - top - whole.h));
    ButtonStyle style;
    style.primary = style.enabled = ready;
    style.icon = module.gate.exam ? Icon::lock : Icon::live;
    style.key = foot.w > 520 ? "Enter" : "";
    const char* begin = module.gate.exam ? "Start exam" : "Practise";
    const float wide = std::min(110 + ui.width(tr(begin), Type::bold), 0.5f * foot.w - 4);
    if (ui.button("begin", foot.take_left(wide, 8), tr(begin), style))
        requests.push_back(open_module(module, place, false));
    if (module.expert.empty()) return;
    style = {};
    style.enabled = !place.path.empty();
    style.icon = Icon::replay;
    style.tip = "The script of an expert, at any speed";
    const float other = std::min(60 + ui.width(tr("Watch the expert"), Type::body), foot.w);
    if (ui.button("expert", foot.take_left(other), tr("Watch the expert"), style))
        requests.push_back(open_module(module, place, true));
}

int shown_module(const CoursePage& page, const CourseStanding& standing) {
    const auto count = static_cast<int>(standing.modules.size());
    if (page.module >= 0 && page.module < count) return page.module;
    return standing.next >= 0 ? standing.next : count - 1;
}

CourseStanding standing_now(const Progress& progress) {
    return course_standing(progress.courses[progress.course], progress.history, progress.answers,
                           utc_now());
}

}  // namespace

bool draw_course_card(const Progress& progress, Screen& screen, Ui& ui, Box& side) {
    constexpr float kHigh = 116;
    if (progress.courses.empty() || side.h < kHigh) return false;
    const Course course = course_in(progress.courses[progress.course], language_in_use().code);
    const CourseStanding standing = standing_now(progress);
    const Box card = side.take_top(kHigh, 12);
    ui.card(card, "course");
    Box room = card.inset(16, 10);
    ui.text(room.take_top(24), course.title, Type::bold, colour::kText, Align::left, true);
    const auto count = static_cast<int>(course.modules.size());
    std::string words = filled(tr("Passed %d of %d"), standing.passed, count);
    if (standing.due > 0) words += " · " + filled(tr("due again: %d"), standing.due);
    if (standing.next >= 0)
        words = course.modules[static_cast<std::size_t>(standing.next)].title + " · " + words;
    ui.text(room.take_top(22, 6), words, Type::small, standing.due ? colour::kWarn : colour::kDim,
            Align::left, true);
    ButtonStyle style;
    style.icon = Icon::next;
    style.tip = "Modules in order, each with its gate";
    if (ui.button("course", room.take_top(44), tr("Course"), style)) screen.page = Page::course;
    return true;
}

void press_course_primary(const Progress& progress,
                          const BundleChooser& chooser,
                          const CoursePage& page,
                          Requests& requests) {
    if (progress.courses.empty()) return;
    const CourseStanding standing = standing_now(progress);
    const auto shown = static_cast<std::size_t>(shown_module(page, standing));
    const CourseModule& module = progress.courses[progress.course].modules[shown];
    const Place place = place_of(module, chooser);
    if (standing.modules[shown].open && !place.path.empty())
        requests.push_back(open_module(module, place, false));
}

void draw_course_page(Progress& progress,
                      Notices& notices,
                      const BundleChooser& chooser,
                      CoursePage& page,
                      Screen& screen,
                      Ui& ui,
                      Requests& requests) {
    const Box window = ui.window();
    const PageLayout layout = page_layout(window.w, window.h);
    Box bar = layout.bar;
    if (back_button(ui, bar, "cases", tr("Cases"), "Back to all cases"))
        screen.page = Page::bundles;
    const CourseStanding standing = standing_now(progress);
    const Course course = course_in(progress.courses[progress.course], language_in_use().code);
    if (progress.courses.size() > 1) {
        ButtonStyle style;
        style.icon = Icon::next;
        style.tip = "Another course of those that are here";
        const float wide = 60 + ui.width(tr("Other course"), Type::body);
        if (ui.button("other_course", bar.take_right(wide, 8).inset(0, 6), tr("Other course"),
                      style)) {
            progress.course = (progress.course + 1) % progress.courses.size();
            progress.class_records.reset();
            page = {};
            return;
        }
    }
    if (!show_notice(notices, ui, bar))
        ui.text(bar, course.title, Type::heading, colour::kText, Align::left, true);
    const int shown = shown_module(page, standing);
    Box content = layout.content;
    const bool wide = layout.columns >= 2;
    Box list = wide ? content.take_left(std::clamp(0.3f * content.w, 220.0f, 360.0f), 16)
                    : content.take_top(content.h < 480 ? 76.0f : 240.0f, 12);
    if (wide && !course.text.empty()) {
        const float high =
            std::min(ui.paragraph_height(list.w, course.text, Type::small), 0.2f * list.h);
        ui.paragraph(list.take_top(high, 10), course.text, Type::small, colour::kDim, true);
    }
    draw_modules(course, standing, shown, page, ui, list);
    draw_module(course, standing, shown, page, chooser, ui, content, requests);
}

}  // namespace sonocase::runtime::inline player_ui
