// SPDX-License-Identifier: Apache-2.0

// The page after an attempt: passed or not, in words; each mark with what was needed; what to do
// differently; the trend; and from there, again, replay, review.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/course_standing.h"
#include "formats/scoring/draw_attempt.h"
#include "runtime/player/app/exam_set.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

std::string needed_words(const ResultRow& row) {
    if (!row.has_limit) return tr("No mark for this");
    const std::string limit = metric_words(row.metric, row.limit);
    if (!row.at_least && row.limit == 0) return tr("Needed: none");
    return filled(tr(row.at_least ? "Needed at least %s" : "Needed at most %s"), limit.c_str());
}

void draw_result(Ui& ui, const Box& box, const ResultRow& row) {
    Box room = box;
    // What was not measured has neither a verdict of its own nor a place on the scale.
    const bool measured = std::isfinite(row.value);
    const unsigned packed = !row.has_limit || !measured ? colour::kDim
                            : row.reached               ? colour::kGood
                                                        : colour::kBad;
    const Icon icon = !measured        ? Icon::minus
                      : !row.has_limit ? Icon::timer
                      : row.reached    ? Icon::pass
                                       : Icon::fail;
    const Box mark = room.take_left(36);
    ui.icon(icon, mark.x, mark.y + 0.5f * mark.h - 12, 24, packed);
    const bool scale = room.w > 560;
    Box value = scale ? Box{} : room.take_right(120, 8);
    // Its ends leave room for a whole mark.
    Box line = scale ? room.take_right(0.42f * room.w, 16).inset(8, 0) : Box{};
    if (scale) value = room.take_right(130, 8);
    const float middle = room.y + 0.5f * room.h;
    // A long title takes two lines.
    const std::string title = tr(row.title);
    const float high = std::min(ui.paragraph_height(room.w, title, Type::bold), 40.0f);
    const float top = middle - 0.5f * (high + 20);
    ui.paragraph({room.x, top, room.w, high}, title, Type::bold, colour::kText, true);
    ui.text({room.x, top + high + 1, room.w, 20}, needed_words(row), Type::small, colour::kDim,
            Align::left, true);
    ui.text(value, metric_words(row.metric, row.value), Type::large, colour::kText, Align::right,
            true);
    if (!scale) return;
    ui.fill({line.x, middle - 2, line.w, 4}, colour::kControlPressed, 2);
    if (row.has_limit) {
        const float x = line.x + row.limit_at * line.w;
        ui.fill({x - 1, middle - 12, 2, 24}, colour::kText);
    }
    if (!measured) return;
    const float x = line.x + row.value_at * line.w;
    if (!row.has_limit || row.reached) {
        ui.disc(x, middle, 6, packed);
    } else {
        ui.diamond(x, middle, 8, packed);
    }
}

// Returns the height taken.
float draw_verdict(Ui& ui, const Box& box, const AttemptResult& result, int hints) {
    Box room = box;
    Box head = room.take_top(64, 4);
    const Icon icon = !result.has_marks ? Icon::check : result.passed ? Icon::pass : Icon::fail;
    const unsigned packed = !result.has_marks ? colour::kDim
                            : result.passed   ? colour::kGood
                                              : colour::kBad;
    ui.icon(icon, head.x, head.y + 10, 44, packed);
    head.take_left(60);
    const char* verdict = !result.has_marks ? "Attempt finished"
                          : result.passed   ? "Passed"
                                            : "Not passed yet";
    ui.text(head.take_top(38), tr(verdict), Type::title);
    std::string all;
    if (result.marks > 0)
        all = filled(tr("%d of %d marks reached."), result.marks_reached, result.marks);
    if (hints > 0) all += (all.empty() ? "" : " ") + filled(tr("Hints used: %d."), hints);
    ui.text(head, all, Type::body, colour::kDim, Align::left, true);
    return 68;
}

// Of an item or a step in the language in use; the name, if the exercise does not have it any more.
template <class Texts>
std::string title_in(const Texts& texts, const std::string& name) {
    for (const auto& one : texts)
        if (one.name == name) return one.title;
    return name;
}

// Of a part of a core: a target or finding by its name, a label in words.
std::string taken_words(const CaseState& loaded, const std::string& region) {
    const Exercise& e = loaded.exercise();
    const auto named = [&](const auto& lesion) { return lesion.name == region; };
    return std::any_of(e.targets.begin(), e.targets.end(), named) ||
                   std::any_of(e.findings.begin(), e.findings.end(),
                               [&](const Finding& f) { return named(f.lesion); })
               ? region
               : tissue_words(region);
}

// The list of a procedure: what was done and what was not, each with its moment in the recording,
// to which its button leads.
void draw_checklist(Ui& ui,
                    Box& room,
                    const Box& seen,
                    const SessionView& session,
                    const ProcedureResult& list,
                    Requests& requests) {
    const ExerciseTexts texts = session.loaded.texts();
    const auto ticked = std::count_if(list.items.begin(), list.items.end(),
                                      [](const auto& item) { return item.ticked; });
    const std::string words = filled(tr("Checklist: %d of %d, %.0f points of %.0f, %.0f needed"),
                                     static_cast<int>(ticked), static_cast<int>(list.items.size()),
                                     list.points, list.max_points, list.cut);
    ui.paragraph(room.take_top(ui.paragraph_height(room.w, words, Type::bold) + 6), words,
                 Type::bold);
    const bool replays = !session.scan.training.score_file.empty();
    int number = 0;
    // A moment of the recording; where the list is scrolled out of its card, no button.
    const auto moment = [&](Box& line, double time_s) {
        ++number;
        if (time_s < 0) return;
        const std::string when = clock_words(time_s);
        const Box box = line.take_right(72, 8);
        ButtonStyle style;
        style.link = true;
        style.tip = "Shows this moment in the replay";
        const std::string id = "moment" + std::to_string(number);
        if (!replays || box.y < seen.y - 1 || box.bottom() > seen.bottom() + 1) {
            ui.text(box, when, Type::small, colour::kDim, Align::centre);
        } else if (ui.button(id.c_str(), box, when, style)) {
            constexpr double kBeforeS = 2;
            requests.push_back(request::StartReplay{std::max(time_s - kBeforeS, 0.0)});
        }
    };
    for (const ProcedureResult::Item& item : list.items) {
        ui.line(room.x, room.y, room.right(), room.y, colour::kLine);
        Box line = room.take_top(44);
        ui.icon(item.ticked ? Icon::check : Icon::fail, line.x + 8, line.y + 11, 20,
                item.ticked ? colour::kGood : colour::kBad);
        line.take_left(44);
        moment(line, item.time_s);
        std::string under = item.ticked ? "" : tr(missed_words(item.why));
        if (item.critical) under += (under.empty() ? "" : " · ") + std::string(tr("critical"));
        const std::string title = title_in(texts.items, item.name);
        ui.text(under.empty() ? line : line.take_top(24), title, Type::body, colour::kText,
                Align::left, true);
        if (!under.empty())
            ui.text(line, under, Type::small, item.ticked ? colour::kDim : colour::kBad,
                    Align::left, true);
    }
    for (const ProcedureResult::Happened& one : list.complications) {
        ui.line(room.x, room.y, room.right(), room.y, colour::kLine);
        Box line = room.take_top(36);
        ui.icon(Icon::warn, line.x + 8, line.y + 8, 20, colour::kBad);
        line.take_left(44);
        moment(line, one.time_s);
        const auto& names = complication_names();
        const auto at = static_cast<std::size_t>(std::find(names.begin(), names.end(), one.name) -
                                                 names.begin());
        if (at < names.size())
            ui.text(line, tr(complication_titles()[at]), Type::body, colour::kText, Align::left,
                    true);
    }
    if (list.stray_acts > list.stray_acts_at_most) {
        const std::string stray =
            filled(tr("%d acts where no step asks for them; at most %d pass."), list.stray_acts,
                   list.stray_acts_at_most);
        room.take_top(ui.paragraph(room, stray, Type::small, colour::kBad, true), 4);
    }
    if (!list.taken.empty()) {
        std::string core = std::string(tr("Last core")) + ":";
        for (const ProcedureResult::Taken& taken : list.taken)
            if (taken.mm >= 1)
                core +=
                    " " + taken_words(session.loaded, taken.region) + text(" %.0f mm,", taken.mm);
        core.pop_back();
        room.take_top(ui.paragraph(room, core, Type::small, colour::kDim, true), 8);
    }
}

std::string advice_words(const SessionView& session) {
    const AttemptResult& result = *session.scan.training.result;
    const CaseState& loaded = session.loaded;
    if (const auto& list = session.scan.training.score->procedure; list && !list->passed) {
        // The first critical item that was missed, else the first of all.
        const ProcedureResult::Item* missed = nullptr;
        for (const ProcedureResult::Item& item : list->items)
            if (!item.ticked && (!missed || (item.critical && !missed->critical))) missed = &item;
        if (missed)
            return std::string(tr("Missing")) + ": " +
                   title_in(loaded.texts().items, missed->name) + ". " +
                   tr(missed_words(missed->why)) + ".";
    }
    if (*result.advice) return tr(result.advice);
    const int mastery = std::max(loaded.exercise().mastery, 1);
    const Standing now =
        standing(session.progress.history, loaded.name(), loaded.exercise().name, mastery);
    if (!result.has_marks)
        return tr("This exercise has no pass marks: compare the measures with your own.");
    if (now.in_a_row >= mastery) {
        if (now.steady)
            return tr(
                "Mastered, and steady by CUSUM. Go on to the next exercise, or try it as an exam.");
        return filled(tr("Mastered. Go on, or stay until you are steady: CUSUM %.1f of %.1f."),
                      now.cusum, kSteadyCusum);
    }
    if (attempt_difficulty(loaded.attempt_seed) < 0)
        return tr(
            "Well done. This was an easier attempt; the next is harder, and attempts as hard "
            "as the exercise is written count towards mastery.");
    return filled(tr("Do it again: %d passes in a row count as mastered; this was %d."), mastery,
                  std::max(now.in_a_row, 1));
}

void draw_advice(Ui& ui, const Box& card, const SessionView& session) {
    ui.card(card, "advice");
    ui.fill({card.x, card.y + 4, 4, card.h - 8}, colour::kAccent, 2);
    Box room = card.inset(16, 12);
    Box head = room.take_top(24, 6);
    ui.icon(Icon::hint, head.x, head.y + 3, 18, colour::kDim);
    ui.text({head.x + 26, head.y, head.w - 26, head.h}, tr("Try this next"), Type::small,
            colour::kDim);
    const std::string words = advice_words(session);
    const bool large = ui.paragraph_height(room.w, words, Type::heading) <= room.h;
    ui.paragraph(room, words, large ? Type::heading : Type::body, colour::kText, true);
}

void draw_trend(Ui& ui, const Box& card, const AttemptResult& result) {
    ui.card(card, "trend");
    Box room = card.inset(16, 12);
    const MetricInfo* info = find_metric(result.trend_metric);
    ui.text(room.take_top(24), tr(info ? info->title : ""), Type::bold, colour::kText, Align::left,
            true);
    ui.text(room.take_top(22, 8), tr("Your attempts"), Type::small, colour::kDim);
    if (room.h < 40 || result.trend.empty()) return;
    Box plot = room;
    const Box axis = plot.take_bottom(20);
    plot = plot.inset(8, 12);
    double low = 0, high = 0;
    for (const double v : result.trend) high = std::max(high, v);
    const ResultRow* row = nullptr;
    for (const ResultRow& r : result.rows) {
        if (r.metric == result.trend_metric) row = &r;
    }
    if (row && row->has_limit) high = std::max(high, row->limit);
    if (!(high > low)) high = low + 1;
    const auto y_of = [&](double v) {
        return plot.bottom() - static_cast<float>((v - low) / (high - low)) * plot.h;
    };
    if (row && row->has_limit) {
        const float y = y_of(row->limit);
        for (float x = plot.x; x < plot.right(); x += 8)
            ui.line(x, y, std::min(x + 4, plot.right()), y, colour::kDim, 1.5f);
    }
    std::vector<float> curve;
    const std::size_t n = result.trend.size();
    const float step = n > 1 ? plot.w / static_cast<float>(n - 1) : 0;
    for (std::size_t i = 0; i < n; ++i) {
        curve.push_back(n > 1 ? plot.x + static_cast<float>(i) * step : plot.x + 0.5f * plot.w);
        curve.push_back(y_of(result.trend[i]));
    }
    ui.curve(curve, colour::kAccent, 2);
    for (std::size_t i = 0; i < n; ++i) {
        const bool last = i + 1 == n;
        ui.disc(curve[2 * i], curve[2 * i + 1], last ? 6.0f : 4.0f,
                last ? colour::kText : colour::kAccent);
        if (last || i == 0)
            ui.text({curve[2 * i] - 16, axis.y, 32, axis.h}, std::to_string(i + 1), Type::small,
                    colour::kDim, Align::centre);
    }
}

// Draws the measures that have a value, by name and value. Returns the height taken.
float draw_all_measures(Ui& ui, Box room, const SessionScore& score) {
    const float from = room.y;
    for (const bool evidence : {true, false}) {
        if (!evidence)
            ui.text(room.take_top(32), tr("Without published evidence"), Type::small, colour::kDim);
        for (const Metric& metric : score.metrics) {
            const MetricInfo* info = find_metric(metric.name);
            if (!info || !std::isfinite(metric.value) || (info->evidence[0] != 0) != evidence)
                continue;
            Box line{room.x, room.y, room.w, 28};
            ui.row(line, tr(info->title), metric_words(metric.name, metric.value));
            room.y += 28;
        }
    }
    return room.y - from;
}

// advice: within the list, where there is no card for it beside.
void draw_results(Ui& ui,
                  const Box& card,
                  const SessionView& session,
                  AfterPage& page,
                  bool advice,
                  Requests& requests) {
    const Training& training = session.scan.training;
    const AttemptResult& result = *training.result;
    ui.card(card, "results");
    const Box inside = card.inset(20, 12);
    ui.clip(inside);
    Box room = inside;
    room.y -= static_cast<float>(page.scroll);
    const float top = room.y;
    room.h = 1e4f;
    room.take_top(draw_verdict(ui, room, result, training.hints_shown), 4);
    if (advice) {
        const std::string words = advice_words(session);
        ui.icon(Icon::hint, room.x + 8, room.y, 24, colour::kAccent);
        const Box place{room.x + 44, room.y, room.w - 56, 100};
        room.take_top(ui.paragraph(place, words, Type::body, colour::kText, true), 12);
    }
    if (training.score->procedure)
        draw_checklist(ui, room, inside, session, *training.score->procedure, requests);
    // Six rows and what follows them fit the smallest window without scrolling.
    const float left = inside.h - (room.y - top) - 45;
    const float high = std::clamp(
        left / static_cast<float>(std::max<std::size_t>(result.rows.size(), 1)), 66.0f, 76.0f);
    for (const ResultRow& row : result.rows) {
        ui.line(room.x, room.y, room.right(), room.y, colour::kLine);
        draw_result(ui, room.take_top(high), row);
    }
    ui.line(room.x, room.y, room.right(), room.y, colour::kLine);
    ButtonStyle style;
    style.link = true;
    style.left = true;
    style.icon = page.all_measures ? Icon::up : Icon::down;
    style.tip = "Every measure of this attempt";
    Box foot = room.take_top(44);
    const char* all = "All measures";
    if (foot.y > inside.y - 1 && foot.bottom() < inside.bottom() + 1 &&
        ui.button("all", {foot.x, foot.y, ui.width(tr(all), Type::body) + 48, 44}, tr(all), style))
        page.all_measures = !page.all_measures;
    if (page.all_measures) room.take_top(draw_all_measures(ui, room, *training.score));
    for (const Message& warning : training.score->warnings)
        room.take_top(ui.paragraph({room.x, room.y, room.w, 60}, tr_message(warning), Type::small,
                                   colour::kWarn, true),
                      4);
    ui.unclip();
    const double over = std::max(0.0f, room.y - top - inside.h);
    ui.scroll_by_wheel(card, page.scroll, over);
}

// In an exam set there is one button: the next exercise. Nothing can be repeated or replayed before
// the set is done.
void draw_exam_buttons(Ui& ui, Box row, const ExamSet& set, Requests& requests) {
    const bool last = set.at + 1 >= set.exercises.size();
    ButtonStyle style;
    style.primary = true;
    style.icon = last ? Icon::check : Icon::next;
    style.key = "Enter";
    const std::string words = tr(last ? "End the exam" : "Next exercise");
    if (ui.button("exam_on", row.take_left(110 + ui.width(words, Type::bold), 16), words, style)) {
        requests.push_back(request::GoOnWithExamSet{});
        return;
    }
    ui.text(row, exam_set_words(set), Type::bold, colour::kText, Align::left, true);
}

void draw_buttons(Ui& ui, Box row, const SessionView& session, Screen& screen, Requests& requests) {
    const ExamSet& exam_set = session.scan.training.exam_set;
    if (exam_set.runs()) {
        draw_exam_buttons(ui, row, exam_set, requests);
        return;
    }
    const struct {
        const char *id, *words, *key, *tip;
        Icon icon;
        bool primary;
    } kButtons[] = {
        {"again", "Try again", "B", "The target gets a new place", Icon::again, true},
        {"replay", "Replay", "P", "Beside the straight way, at any speed", Icon::replay, false},
        {"review", "Review page", "R", "All of this attempt on one page", Icon::review, false}};
    const bool narrow = row.w < 760;
    for (const auto& b : kButtons) {
        ButtonStyle style;
        style.primary = b.primary;
        style.icon = b.icon;
        style.key = narrow ? "" : b.key;
        style.tip = b.tip;
        const float wide = narrow ? (row.w - 16) / (b.primary                ? 3.0f
                                                    : b.icon == Icon::replay ? 2.0f
                                                                             : 1.0f)
                                  : 100 + ui.width(tr(b.words), Type::bold);
        if (!ui.button(b.id, row.take_left(wide, 8), tr(b.words), style)) continue;
        if (b.primary) requests.push_back(request::ToggleAttempt{});
        if (b.icon == Icon::replay) requests.push_back(request::StartReplay{});
        if (b.icon == Icon::review) requests.push_back(request::OpenReview{});
    }
    if (screen.in_course) {
        ButtonStyle style;
        style.icon = Icon::next;
        style.tip = "How the gate stands, and the next module";
        const Box box = row.take_right(std::min(60 + ui.width(tr("Course"), Type::body), row.w));
        if (box.w > 44 && ui.button("course", box, box.w > 80 ? tr("Course") : "", style))
            screen.page = Page::course;
        return;
    }
    const CaseState& loaded = session.loaded;
    const auto count = static_cast<int>(loaded.open->exercises.size());
    if (narrow || count < 2) return;
    const std::string words =
        std::string(tr("Next")) + ": " +
        texts_of(*loaded.open, (loaded.exercise_index + 1) % count, language_in_use().code).title;
    ButtonStyle style;
    style.ghost = true;
    style.may_cut = true;
    const Box box = row.take_right(std::min(ui.width(words, Type::body) + 22, row.w));
    if (box.w > 80 && ui.button("next", box, words, style)) {
        requests.push_back(request::ChooseExercise{.index = loaded.exercise_index + 1});
    }
}

}  // namespace

void draw_after_page(
    const SessionView& session, Notices& notices, Screen& screen, Ui& ui, Requests& requests) {
    const Training& training = session.scan.training;
    const Box window = ui.window();
    const PageLayout page = page_layout(window.w, window.h);
    Box bar = page.bar;
    if (back_button(ui, bar, "scan", tr("Scan"), "Back to the picture (Esc)"))
        screen.page = Page::scan;
    ButtonStyle style;
    style.ghost = true;
    style.icon = Icon::settings;
    style.tip = "Settings and panels";
    if (ui.button("settings", bar.take_right(44, 8).inset(0, 2), "", style))
        screen.dialog = Dialog::settings;
    const std::string title = session.loaded.texts().title;
    if (!show_notice(notices, ui, bar))
        ui.text(bar, title + " · " + tr(training.exam ? "exam" : "practice"), Type::body,
                colour::kDim, Align::left, true);
    Box content = page.content;
    draw_buttons(ui, content.take_bottom(56, 12), session, screen, requests);
    if (page.columns >= 2) {
        Box side = content.take_right(std::min(364.0f, 0.34f * content.w), 16);
        draw_advice(ui, side.take_top(std::min(150.0f, 0.4f * side.h), 12), session);
        if (!training.result->trend_metric.empty() && side.h > 120)
            draw_trend(ui, side.take_top(std::min(260.0f, side.h)), *training.result);
    }
    draw_results(ui, content, session, screen.after, page.columns < 2, requests);
}

}  // namespace sonocase::runtime::inline player_ui
