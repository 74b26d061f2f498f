// SPDX-License-Identifier: Apache-2.0

// The task: what to do, where the needle is, how the attempt goes, and the button that starts and
// ends it.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/scoring/sight.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

constexpr float kRow = 28, kSmallBelow = 8, kNeedleHigh = 44;

const char* const kSteps[] = {"Find the target", "Bring the needle into the plane",
                              "Advance with the tip in view", "Stop in the middle"};
// Of the mouse's tools, in each step.
const char* const kStepKeys[] = {
    "Arrows slide the probe, Shift + arrows tilt it, Q and E turn it.",
    "N takes the needle, A and D aim it, W pushes it in.",
    "W pushes, S pulls back. If the tip fades, stop and tilt the probe.",
    "With the tip in the middle of the target, press B."};
constexpr const char* kAllKeys = "Arrows: probe. N: needle. W, S: push, pull. B: end.";

// Which of the four steps is to be done now; 4: all are.
int present_step(const TaskCardInput& input) {
    const std::vector<bool>& reached = input.targets_reached;
    if (!reached.empty() && std::find(reached.begin(), reached.end(), false) == reached.end())
        return 4;
    const StepsDone& done = input.steps;
    return !done.target_seen ? 0 : !done.needle_seen ? 1 : !done.tip_near ? 2 : 3;
}

// Where the nearest target lies beside the picture, and which way leads there.
std::string where_target(const TaskCardInput& input) {
    const Point3* nearest = nullptr;
    Point3 at{0, 1e9, 0};
    const Rigid probe_from = inverse(input.record.tools.mannequin_from_probe);
    for (const Point3& centre : input.target_centres) {
        const Point3 p = probe_from * centre;
        if (std::abs(p.y) < std::abs(at.y)) {
            at = p;
            nearest = &centre;
        }
    }
    if (!nearest || !input.record.tools.has_probe) return tr("The target is shown.");
    const double beside = distance_to_image(input.exercise.probe, at.x, at.z);
    if (std::abs(at.y) <= 3 && beside == 0) return tr("The target is in the picture, in the ring.");
    const bool off_plane = std::abs(at.y) >= beside;
    const double by_mm = off_plane ? std::abs(at.y) : beside;
    if (!input.mouse)
        return text(tr(off_plane ? "The target lies %.0f mm beside the plane."
                                 : "The target lies %.0f mm beside the picture."),
                    by_mm);
    const bool right = (at.x > 0) != input.flipped;
    const char* words =
        off_plane ? (at.y > 0 ? "The target lies %.0f mm beside the plane: arrow up leads there."
                              : "The target lies %.0f mm beside the plane: arrow down leads there.")
        : at.z > 0 && std::abs(at.x) < 1 ? "The target lies %.0f mm beside the picture."
        : right ? "The target lies %.0f mm beside the picture: arrow right leads there."
                : "The target lies %.0f mm beside the picture: arrow left leads there.";
    return text(tr(words), by_mm);
}

const ProcedureView* shown_procedure(const TaskCardInput& input) {
    return input.attempt && !input.replays ? input.procedure : nullptr;
}

// The last hint asked for; empty: none was, or the procedure is in a later step and needs the room.
std::string hint_words(const TaskCardInput& input) {
    constexpr double kReading_s = 12;
    const int count = static_cast<int>(input.texts.hints.size());
    const ProcedureView* procedure = shown_procedure(input);
    const bool past = procedure && procedure->present_step != input.hint_step &&
                      input.attempt->view().seconds > input.hint_s + kReading_s;
    if (input.hints_shown == 0 || past) return "";
    return input.hints_shown > count ? where_target(input)
                                     : input.texts.hints[input.hints_shown - 1];
}

constexpr float kHintHead = 30;

float hint_height(const Ui& ui, float width, const TaskCardInput& input) {
    const std::string words = hint_words(input);
    return kHintHead +
           (words.empty() ? 0 : ui.paragraph_height(width - 20, words, Type::small) + 10);
}

// Of a part of a core: a target, a finding, or a label of the case.
std::string taken_words(const TaskCardInput& input, const ProcedureState::Taken& taken) {
    const Exercise& e = input.exercise;
    if (taken.label >= 0)
        return tissue_words(input.labels[static_cast<std::size_t>(taken.label)].name);
    const auto target = static_cast<std::size_t>(-1 - taken.label);
    return target < e.targets.size() ? e.targets[target].name
                                     : e.findings[target - e.targets.size()].lesion.name;
}

// What the hands have done so far, in one line; empty: nothing.
std::string done_words(const TaskCardInput& input, const ProcedureState& state) {
    std::string line;
    const auto add = [&](const std::string& words) { line += (line.empty() ? "" : " · ") + words; };
    const double injected = state.injected_ml + state.injected_lost_ml;
    if (injected > 0) add(text(tr("%.0f ml injected"), injected));
    if (state.aspirated >= 0)
        add(std::string(tr("drawn")) + ": " +
            tr(aspirate_names()[static_cast<std::size_t>(state.aspirated)].c_str()));
    if (state.throws > 0) {
        std::string core;
        for (int i = 0; i < state.taken_count; ++i) {
            const ProcedureState::Taken& taken = state.taken[static_cast<std::size_t>(i)];
            if (taken.mm < 1) continue;
            core +=
                (core.empty() ? "" : ", ") + taken_words(input, taken) + text(" %.0f mm", taken.mm);
        }
        add(std::string(tr("core")) + ": " + (core.empty() ? tr("nothing") : core));
    }
    if (state.wire_in) add(text(tr("wire %.0f mm in"), state.wire_mm));
    if (state.catheter_in) add(tr("catheter lies"));
    if (state.drained_ml > 0) add(text(tr("%.0f ml drained"), state.drained_ml));
    if (state.compressed_s > 0) add(text(tr("%.0f s pressed"), state.compressed_s));
    return line;
}

float below_values(const Ui& ui, float width, const TaskCardInput& input) {
    if (!input.attempt) return 0;
    return 4 + (input.exam ? 40 : hint_height(ui, width, input));
}

// What the values and the hints of the card take below what stands above them. Before the needle
// is used its values say nothing: then the task's words go first.
float kept_free(const Ui& ui, float width, const TaskCardInput& input) {
    if (!input.attempt) return 3 * kRow;
    const bool used = input.record.tools.has_needle || input.attempt->view().insertions > 0;
    const float rows = !used ? 0 : input.exam ? 1 : input.shows_targets ? 3 : 2;
    return 6 + rows * kRow + below_values(ui, width, input);
}

// Small words where they fit whole.
void draw_small(Ui& ui, Box& room, const std::string& words, float free) {
    const float high = ui.paragraph_height(room.w, words, Type::small);
    if (high + kSmallBelow + free > room.h) return;
    ui.paragraph(room.take_top(high, kSmallBelow), words, Type::small, colour::kDim);
}

void draw_steps(Ui& ui, Box& room, const TaskCardInput& input) {
    const int now = present_step(input);
    const Box tabs = room.take_top(28, 6);
    for (int i = 0; i < 4; ++i) {
        const Box tab = tabs.column(i, 4, 4);
        ui.fill(tab, i == now ? colour::kChosen : colour::kControl, 4);
        if (i == now) ui.fill({tab.x, tab.bottom() - 3, tab.w, 3}, colour::kAccent, 1.5f);
        if (i < now) {
            ui.icon(Icon::check, tab.x + 0.5f * tab.w - 9, tab.y + 5, 18, colour::kGood);
        } else {
            ui.text(tab, std::to_string(i + 1), i == now ? Type::bold : Type::body,
                    i == now ? colour::kText : colour::kDim, Align::centre);
        }
    }
    const char* words = now < 4 ? kSteps[now] : "All targets reached";
    const float high = std::min(ui.paragraph_height(room.w, tr(words), Type::bold), 36.0f);
    ui.paragraph(room.take_top(high, 4), tr(words), Type::bold, colour::kText, true);
    if (input.mouse && now < 4)
        draw_small(ui, room, tr(kStepKeys[now]), kept_free(ui, room.w, input));
}

void draw_values(Ui& ui, Box& room, const TaskCardInput& input) {
    const FrameRecord& record = input.record;
    const bool needle = input.live && record.tools.has_needle;
    const bool asks_for_needle = needle || input.exercise.kind != "scan";
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    const float below = below_values(ui, room.w, input);
    const auto row = [&](const char* name, const std::string& value, unsigned packed) {
        if (room.h < kRow + below) return;
        ui.row(room.take_top(kRow), tr(name), value, packed);
    };
    if (input.shows_targets && !input.exam) {
        double nearest = 1e9;
        for (const Point3& centre : input.target_centres)
            nearest = std::min(nearest, distance(tip, centre));
        if (!input.target_centres.empty())
            row("Tip to target", needle ? text("%.0f mm", nearest) : "–", colour::kText);
    }
    if (needle && input.exercise.needle.make->echogenic && room.h >= 34)
        draw_small(ui, room, tr(input.exercise.needle.make->about), kRow);
    if (!input.attempt) {
        if (input.exam || !asks_for_needle) return;
        row("Needle depth",
            needle && record.needle.depth_mm > 0 ? text("%.0f mm", record.needle.depth_mm) : "–",
            colour::kText);
        return;
    }
    const AttemptView view = input.attempt->view();
    if (!input.exam && asks_for_needle) {
        const bool inside = needle && view.depth_mm > 0;
        const bool seen = inside && view.tip_in_view;
        row("Tip in view",
            !inside ? "–"
            : seen  ? tr("Yes")
                    : tr("No"),
            !inside ? colour::kDim
            : seen  ? colour::kGood
                    : colour::kWarn);
    }
    if (asks_for_needle || view.insertions > 0)
        row("Skin punctures", std::to_string(view.insertions), colour::kText);
    if (view.in_no_go && !input.exam && room.h >= 20) {
        const Box line = room.take_top(22, 4);
        ui.icon(Icon::warn, line.x, line.y + 2, 18, colour::kBad);
        ui.text({line.x + 24, line.y, line.w - 24, line.h}, tr("Critical structure touched"),
                Type::small, colour::kBad, Align::left, true);
    }
    if (!view.problem.empty())
        room.take_top(
            ui.paragraph(room, tr_message(view.problem), Type::small, colour::kBad, true));
}

void draw_step_tab(Ui& ui, const Box& tab, int number, StepState state) {
    const bool now = state == StepState::present;
    ui.fill(tab, now ? colour::kChosen : colour::kControl, 4);
    if (now) ui.fill({tab.x, tab.bottom() - 3, tab.w, 3}, colour::kAccent, 1.5f);
    const bool waits = now || state == StepState::waiting;
    if (waits) {
        ui.text(tab, std::to_string(number), now ? Type::bold : Type::body,
                now ? colour::kText : colour::kDim, Align::centre);
    } else {
        const bool done = state == StepState::done;
        ui.icon(done ? Icon::check : Icon::warn, tab.x + 0.5f * tab.w - 9, tab.y + 5, 18,
                done ? colour::kGood : colour::kWarn);
    }
}

// The step to be done now; null: all are over.
const ExerciseTexts::Step* present_step_words(const TaskCardInput& input) {
    const int step = input.procedure->present_step;
    return step < 0 ? nullptr : &input.texts.steps[static_cast<std::size_t>(step)];
}

std::string step_title(const TaskCardInput& input) {
    const ExerciseTexts::Step* step = present_step_words(input);
    return step            ? step->title
           : input.replays ? tr("The procedure is over")
                           : tr("All steps are behind you: finish the attempt");
}

constexpr const char* kQuestionWaits = "A question waits";
constexpr float kTabsHigh = 28, kTabsBelow = 6, kTitleBelow = 4;
constexpr float kComplicationHigh = 22, kComplicationBelow = 2;

// What stands below the present step: what was done, and what went wrong.
float done_high(const Ui& ui, float width, const TaskCardInput& input) {
    const ProcedureState& state = input.procedure->state;
    const std::string done = done_words(input, state);
    float sum = done.empty() ? 0 : ui.paragraph_height(width, done, Type::small) + kSmallBelow;
    if (input.exam && !input.replays) return sum;
    for (const double seconds : state.complication_s)
        if (seconds >= 0) sum += kComplicationHigh + kComplicationBelow;
    return sum;
}

// Whether a question was put off. It stands as the last tab of the steps where there are tabs,
// which costs no room; elsewhere as a line of its own.
bool question_waits(const TaskCardInput& input) {
    return !input.replays && next_question(input.exercise.procedure, input.procedure->state) >= 0;
}
constexpr int kMaxTabs = 10;
bool has_tabs(const TaskCardInput& input) {
    const int count = static_cast<int>(input.texts.steps.size());
    return (!input.exam || input.replays) && count > 0 && count <= kMaxTabs;
}

// The steps of a procedure: which are done, and what is to be done now.
void draw_procedure_steps(Ui& ui, Box& room, const TaskCardInput& input, TaskCardRequest& request) {
    const ProcedureView& view = *input.procedure;
    const int count = static_cast<int>(input.texts.steps.size());
    if (count == 0 || room.h < 30) return;
    if (has_tabs(input)) {
        const bool waits = question_waits(input);
        const int columns = count + (waits ? 1 : 0);
        const Box tabs = room.take_top(kTabsHigh, kTabsBelow);
        for (int i = 0; i < count; ++i)
            draw_step_tab(ui, tabs.column(i, columns, 4), i + 1,
                          view.steps[static_cast<std::size_t>(i)]);
        ButtonStyle style;
        style.link = true;
        style.tip = kQuestionWaits;
        if (waits && ui.button("ask", tabs.column(count, columns, 4), "?", style))
            request.put_off = -1;
    } else {
        ui.text(room.take_top(20, 4),
                filled(tr("Step %d of %d"), view.present_step < 0 ? count : view.present_step + 1,
                       count),
                Type::small, colour::kDim);
    }
    const ExerciseTexts::Step* step = present_step_words(input);
    const std::string title = step_title(input);
    const float high = std::min(ui.paragraph_height(room.w, title, Type::bold), 40.0f);
    // A hint that was asked for says more of this step than its title.
    float free = done_high(ui, room.w, input);
    if (!input.exam && !hint_words(input).empty()) free += below_values(ui, room.w, input);
    if (room.h < high + free) return;
    ui.paragraph(room.take_top(high, kTitleBelow), title, Type::bold, colour::kText, true);
    if (step) draw_small(ui, room, step->instruction, free);
}

constexpr float kAskHigh = 28;  // of the link to a question that was put off

// What a procedure's card shows above its tray when it cuts nothing: steps, the present one in
// words, what was done, the hint.
float whole_standing(const Ui& ui, float width, const TaskCardInput& input, bool instructs) {
    float sum = done_high(ui, width, input);
    if (question_waits(input) && !has_tabs(input)) sum += kAskHigh + 4;
    if (input.exam) return sum;
    if (!input.texts.steps.empty()) {
        const ExerciseTexts::Step* step = present_step_words(input);
        sum += kTabsHigh + kTabsBelow + kTitleBelow +
               ui.paragraph_height(width, step_title(input), Type::bold);
        if (instructs && step && !step->instruction.empty())
            sum += ui.paragraph_height(width, step->instruction, Type::small) + kSmallBelow;
    }
    return sum + 4 + hint_height(ui, width, input) + 8;
}

struct TrayRows {
    int rows = 0;
    float high = 38, between = 6;
    float whole() const { return static_cast<float>(rows) * (high + between) - between + 8; }
};

// Lower rows where the room is too small for full ones below everything else.
TrayRows tray_rows(float room_high, float standing, int cells) {
    TrayRows tray{(cells + 1) / 2};
    standing = std::max(standing, 108.0f);
    for (const float high : {30.0f, 28.0f}) {
        if (tray.rows == 0 || tray.whole() + standing <= room_high) break;
        tray.high = high;
        tray.between = high - 26;
    }
    return tray;
}

int tray_cells(const TaskCardInput& input) {
    return static_cast<int>(tray_now(input.exercise.procedure, input.procedure->state).size()) +
           (input.mouse ? 1 : 0);
}

// What the card's head shows: the title, which the bar above the picture says too; attempt and
// clock, which the button takes over.
struct Head {
    bool title = true, attempt = true;
    bool low = false;  // the card has no room for whole hints
};
constexpr float kAttemptHigh = 22, kBelowAttempt = 8;

float title_high(const Ui& ui, float width, const TaskCardInput& input) {
    return std::min(ui.paragraph_height(width, input.texts.title, Type::heading),
                    2 * ui.line_height(Type::heading) + 1);
}

// What the card of an attempt without a procedure shows below its head when it cuts nothing.
float whole_task(const Ui& ui, float width, const TaskCardInput& input, bool described) {
    const auto high = [&](const std::string& words, Type type) {
        return ui.paragraph_height(width, words, type);
    };
    float sum = kNeedleHigh + 8 + kept_free(ui, width, input);
    if (described) sum += high(input.texts.description, Type::small) + kSmallBelow;
    if (input.exam) return sum + (input.mouse ? high(tr(kAllKeys), Type::small) + kSmallBelow : 0);
    const int now = present_step(input);
    sum += kTabsHigh + kTabsBelow + kTitleBelow +
           high(tr(now < 4 ? kSteps[now] : "All targets reached"), Type::bold);
    return sum + (input.mouse && now < 4 ? high(tr(kStepKeys[now]), Type::small) + kSmallBelow : 0);
}

// As much of the head as leaves room for the task and its hint, whole. room: above the button.
Head head_of(const Ui& ui, const Box& room, const TaskCardInput& input) {
    constexpr float kLowCard = 300;  // question or tray of a procedure need all of it
    if (!shown_procedure(input)) {
        if (!input.attempt || input.replays || input.guide) return {};
        for (const bool described : {true, false}) {
            const float left = room.h - whole_task(ui, room.w, input, described);
            if (title_high(ui, room.w, input) + 4 + kAttemptHigh + kBelowAttempt <= left) return {};
            if (kAttemptHigh + kBelowAttempt <= left) return {false, true};
            if (left >= 0) return {false, false};
        }
        return {};
    }
    if (room.h <= kLowCard) return {false, false, true};
    if (next_question(input.exercise.procedure, input.procedure->state, input.put_off) >= 0)
        return {};
    const float attempt = kAttemptHigh + kBelowAttempt;
    const int cells = tray_cells(input);
    for (const bool instructs : {true, false}) {
        const float standing = whole_standing(ui, room.w, input, instructs);
        const auto fits = [&](float head) {
            return head + standing + tray_rows(room.h - head, standing, cells).whole() <= room.h;
        };
        if (fits(title_high(ui, room.w, input) + 4 + attempt)) return {};
        if (fits(attempt)) return {false, true};
        if (fits(0)) return {false, false};
    }
    return {false, false, true};
}

// What lies ready, two to a row from the bottom up; the needle of the mouse first.
void draw_tray(
    Ui& ui, Box& room, const TaskCardInput& input, const TrayRows& rows, TaskCardRequest& request) {
    const std::vector<TrayAct> tray = tray_now(input.exercise.procedure, input.procedure->state);
    const int needle = input.mouse ? 1 : 0;
    const int cells = static_cast<int>(tray.size()) + needle;
    if (cells == 0) return;
    const float high = rows.high, between = rows.between;
    Box place = room.take_bottom(rows.whole() - 8, 8);
    for (int cell = 0; cell < cells; ++cell) {
        const int line = cell / 2;
        const float down = static_cast<float>(line) * (high + between);
        if (down + high > place.h + 1) break;
        const Box box = Box{place.x, place.y + down, place.w, high}.column(cell % 2, 2, between);
        ButtonStyle style;
        if (cell < needle) {
            style.key = "N";
            style.tip = "Shift + N puts it across the plane";
            // Half a card has no room for "Withdraw needle".
            request.toggle_needle = ui.button(
                "needle", box, tr(input.mouse->has_needle() ? "Needle out" : "Take needle"), style);
            continue;
        }
        const int i = cell - needle;
        const TrayAct& act = tray[static_cast<std::size_t>(i)];
        style.enabled = input.live;
        style.may_cut = true;
        if (i < kTrayKeys) style.key = style.tip = tray_key(i);
        const std::string id = "act" + std::to_string(i);
        if (ui.button(id.c_str(), box, tr(act.words), style)) request.act = act.act;
    }
}

// Words on a control that take several lines.
bool wrapped_button(
    Ui& ui, const char* id, const Box& box, const std::string& words, Type type, bool enabled) {
    ButtonStyle style;
    style.enabled = enabled;
    const bool pressed = ui.button(id, box, "", style);
    const float high = std::min(ui.paragraph_height(box.w - 20, words, type), box.h - 4);
    ui.begin_in_control();
    ui.paragraph({box.x + 10, box.y + 0.5f * (box.h - high), box.w - 20, high}, words, type,
                 colour::kText, true);
    ui.end_in_control();
    return pressed;
}

// A question of the procedure, in all of the room; in small words where they do not fit.
void draw_question(
    Ui& ui, Box& room, const TaskCardInput& input, int question, TaskCardRequest& request) {
    const ExerciseTexts::Item& item = input.texts.items[static_cast<std::size_t>(question)];
    constexpr float kLater = 28, kBetween = 4;
    const float width = room.w - 20;
    const auto option_high = [&](const std::string& option, Type type) {
        return ui.paragraph_height(width - 20, option, type) + (type == Type::body ? 20 : 10);
    };
    const auto whole = [&](Type type) {
        float high = ui.paragraph_height(width, item.question, type) + 24 + kLater;
        for (const std::string& option : item.options) high += option_high(option, type) + kBetween;
        return high;
    };
    const Type type = whole(Type::body) <= room.h ? Type::body : Type::small;
    if (whole(type) > room.h) return;  // a notice is in its place
    Box card = room.take_top(whole(type));
    ui.card(card, "question", colour::kRaised);
    card = card.inset(10, 8);
    const float high = ui.paragraph_height(width, item.question, type);
    ui.paragraph(card.take_top(high, 8), item.question, type);
    for (std::size_t o = 0; o < item.options.size(); ++o) {
        const Box box = card.take_top(option_high(item.options[o], type), kBetween);
        const std::string id = "option" + std::to_string(o);
        if (wrapped_button(ui, id.c_str(), box, item.options[o], type, input.live)) {
            request.act =
                Act{.kind = ActKind::answer, .index = question, .amount = static_cast<double>(o)};
            request.put_off = -1;
        }
    }
    ButtonStyle later;
    later.link = true;
    later.tip = "It is asked again when the next question is answered";
    if (ui.button("later", {card.x, card.y, ui.width(tr("Later"), Type::body) + 16, kLater},
                  tr("Later"), later))
        request.put_off = question;
}

// Where a procedure stands: its steps, what was done, and what went wrong. An exam that runs says
// what was done alone.
void draw_standing(Ui& ui, Box& room, const TaskCardInput& input, TaskCardRequest& request) {
    const bool tells = !input.exam || input.replays;
    const ProcedureState& state = input.procedure->state;
    if (tells) draw_procedure_steps(ui, room, input, request);
    const std::string done = done_words(input, state);
    if (!done.empty()) draw_small(ui, room, done, 0);
    for (std::size_t k = 0; tells && k < state.complication_s.size(); ++k) {
        if (state.complication_s[k] < 0 || room.h < 24) continue;
        const Box line = room.take_top(kComplicationHigh, kComplicationBelow);
        ui.icon(Icon::warn, line.x, line.y + 2, 18, colour::kBad);
        ui.text({line.x + 24, line.y, line.w - 24, line.h}, tr(complication_titles()[k]),
                Type::small, colour::kBad, Align::left, true);
    }
}

// Hints asked for so far, the last one in full; where that does not fit, one line and a button.
void draw_hints(
    Ui& ui, Box& room, const TaskCardInput& input, bool may_cut, TaskCardRequest& request) {
    const int count = static_cast<int>(input.texts.hints.size());
    if (room.h < kHintHead) return;
    const std::string words = hint_words(input);
    const float high = std::min(hint_height(ui, room.w, input), room.h);
    Box card = room.take_top(high, 8);
    ui.card(card, "hint", colour::kRaised);
    Box head = card.take_top(kHintHead);
    ui.icon(Icon::hint, head.x + 10, head.y + 0.5f * head.h - 9, 18, colour::kDim);
    const int shown = std::min(input.hints_shown, count + 1);
    std::string line = shown == 0 ? filled(tr("%d hints"), count + 1)
                                  : filled(tr("Hint %d of %d"), shown, count + 1);
    if (input.hints_shown <= count) {
        ButtonStyle style;
        style.link = true;
        style.key = "H";
        style.tip = "Hints used are noted in the result";
        const char* next = input.hints_shown < count ? "Next hint" : "Show target";
        const float wide = ui.width(tr(next), Type::body) + 44;
        request.next_hint = ui.button("hint", head.take_right(wide), tr(next), style);
    }
    if (shown > 0 && ui.width(line, Type::small) > head.w - 34)
        line = filled("%d / %d", shown, count + 1);
    ui.text({head.x + 34, head.y, head.w - 34, head.h}, line, Type::small, colour::kDim,
            Align::left, true);
    if (!words.empty() && card.h > 18)
        ui.paragraph({card.x + 10, card.y, card.w - 20, card.h - 2}, words, Type::small,
                     colour::kText, may_cut);
}

// The card while a procedure runs.
void draw_procedure(
    Ui& ui, Box& room, const TaskCardInput& input, bool low, TaskCardRequest& request) {
    const Procedure& procedure = input.exercise.procedure;
    const ProcedureState& state = input.procedure->state;
    const int question = next_question(procedure, state, input.put_off);
    if (question >= 0) return draw_question(ui, room, input, question, request);
    const TrayRows rows =
        tray_rows(room.h, whole_standing(ui, room.w, input, true), tray_cells(input));
    if (question_waits(input) && !has_tabs(input)) {
        ButtonStyle style;
        style.link = true;
        const float wide = ui.width(tr(kQuestionWaits), Type::body) + 16;
        if (ui.button("ask", room.take_top(kAskHigh, 4).take_left(wide), tr(kQuestionWaits), style))
            request.put_off = -1;
    }
    draw_tray(ui, room, input, rows, request);  // before the steps: without it nothing can be done
    draw_standing(ui, room, input, request);
    draw_values(ui, room, input);
    if (input.exam) return;
    room.take_top(4);
    draw_hints(ui, room, input, low, request);
}

void draw_guide(Ui& ui, Box& room, const TaskCardInput& input, TaskCardRequest& request) {
    const GuideStep step = input.guide->step();
    Box card = room.take_top(std::min(room.h, 210.0f), 8);
    ui.card(card, "guide", colour::kRaised);
    ui.fill({card.x, card.y + 6, 4, card.h - 12}, colour::kAccent, 2);
    card = card.inset(14, 8);
    ui.text(card.take_top(20),
            filled(tr("Step %d of %d"), static_cast<int>(step) + 1, kGuideSteps + 1), Type::small,
            colour::kDim);
    ui.text(card.take_top(26), tr(guide_title(step)), Type::bold, colour::kText, Align::left, true);
    ButtonStyle style;
    style.link = true;
    style.tip = "Go on without doing this";
    const Box foot = card.take_bottom(36);
    if (step != GuideStep::done)
        request.skip_guide =
            ui.button("skip", {foot.x, foot.y, ui.width(tr("Skip"), Type::body) + 12, foot.h},
                      tr("Skip"), style);
    ui.paragraph(card, tr(guide_words(step)), Type::small, colour::kText, true);
}

// The title of an attempt that is easier or harder than the exercise as written.
const char* attempt_words(int difficulty) {
    return difficulty < -1    ? "Attempt %d · much easier"
           : difficulty == -1 ? "Attempt %d · easier"
           : difficulty == 1  ? "Attempt %d · harder"
                              : "Attempt %d · much harder";
}

void draw_head(Ui& ui, Box& room, const TaskCardInput& input, const Head& head) {
    const Exercise& exercise = input.exercise;
    if (head.title)
        ui.paragraph(room.take_top(title_high(ui, room.w, input), 4), input.texts.title,
                     Type::heading, colour::kText, true);
    if (!head.attempt) return;
    const std::string words =
        input.attempt && input.difficulty != 0
            ? filled(tr(attempt_words(input.difficulty)), input.attempt_number)
            : filled(tr("Attempt %d · difficulty %d of 5"), input.attempt_number,
                     exercise.difficulty);
    Box second = room.take_top(kAttemptHigh, kBelowAttempt);
    if (input.attempt) {
        const std::string time = clock_words(input.attempt->view().seconds);
        const Box clock = second.take_right(ui.width(time, Type::bold) + 28);
        ui.icon(Icon::timer, clock.x + 2, clock.y + 2, 18, colour::kDim);
        ui.text({clock.x + 24, clock.y, clock.w - 24, clock.h}, time, Type::bold);
    }
    ui.text(second, words, Type::small, colour::kDim, Align::left, true);
}

}  // namespace

const char* tray_key(int i) {
    constexpr const char* kKeys[kTrayKeys] = {"J",        "K",        "L",        "I",
                                              "Ctrl + J", "Ctrl + K", "Ctrl + L", "Ctrl + I"};
    return kKeys[i];
}

bool draw_attempt_button(Ui& ui, const Box& box, const TaskCardInput& input, bool with_clock) {
    ButtonStyle style;
    style.primary = true;
    style.key = input.replays ? "P" : "B";
    style.icon = input.replays ? Icon::close : input.attempt ? Icon::check : Icon::live;
    style.enabled = input.live || input.replays;
    style.tip = input.replays   ? "Back to the result"
                : input.attempt ? "Ends and scores it"
                                : "The target gets a new place, and the time starts";
    const char* words = input.replays   ? "End replay"
                        : input.attempt ? "Finish attempt"
                                        : "Start attempt";
    std::string shown = tr(words);
    if (input.attempt && with_clock) shown += " · " + clock_words(input.attempt->view().seconds);
    return ui.button("attempt", box, shown, style);
}

TaskCardRequest draw_task_card(Ui& ui, const Box& card, const TaskCardInput& input) {
    TaskCardRequest request;
    ui.card(card, "task");
    Box room = card.inset(12);
    const Box button = input.shows_finish ? room.take_bottom(48, 8) : Box{};
    const Head head = head_of(ui, room, input);
    if (input.shows_finish) {
        const bool pressed = draw_attempt_button(ui, button, input, !head.attempt);
        (input.replays ? request.end_replay : request.toggle_attempt) = pressed;
    }
    draw_head(ui, room, input, head);
    if (!input.replays && !shown_procedure(input) && room.h > 150 &&
        (input.mouse || !input.attempt)) {
        Box links = room.take_bottom(kNeedleHigh, 8);
        ButtonStyle style;
        if (input.has_result && !input.attempt) {
            style.icon = Icon::review;
            style.tip = "The result of the last attempt";
            const Box place = input.mouse ? links.take_left(44, 8) : links;
            request.show_result =
                ui.button("result", place, input.mouse ? "" : tr("Result"), style);
        }
        if (input.mouse) {
            style.icon = Icon::needle;
            style.key = "N";
            style.tip = "Shift + N puts it across the plane";
            request.toggle_needle =
                ui.button("needle", links,
                          tr(input.mouse->has_needle() ? "Withdraw needle" : "Take needle"), style);
        }
    }
    if (input.guide) {
        draw_guide(ui, room, input, request);
        return request;
    }
    if (input.replays) {
        if (input.procedure != nullptr) {
            draw_standing(ui, room, input, request);
            room.take_top(8);
        }
        ui.paragraph(
            room,
            tr(input.expert ? "How it is done. The bar below the picture goes to any moment, at "
                              "any speed."
                            : "What was done, beside the straight way (dotted). The bar below the "
                              "picture goes to any moment, at any speed."),
            Type::small, colour::kDim, true);
        return request;
    }
    if (shown_procedure(input)) {
        draw_procedure(ui, room, input, head.low, request);
        return request;
    }
    if (input.attempt && !input.exam && room.h > 150) draw_steps(ui, room, input);
    if (input.attempt && input.exam && input.mouse)
        draw_small(ui, room, tr(kAllKeys), kept_free(ui, room.w, input));
    const std::string& words = input.texts.description;
    if (!words.empty()) {
        const float whole = ui.paragraph_height(room.w, words, Type::small);
        const float high =
            std::min(whole, std::max(room.h - 8 - kept_free(ui, room.w, input), 0.0f));
        // In an attempt one line of several says nothing.
        if (high >= (input.attempt ? std::min(whole, 34.0f) : 17.0f))
            ui.paragraph(room.take_top(high, 8), words, Type::small, colour::kDim, true);
    }
    if (room.h > 8) {
        ui.line(room.x, room.y, room.right(), room.y, colour::kLine);
        room.take_top(6);
    }
    draw_values(ui, room, input);
    if (input.attempt && input.exam) {
        ui.paragraph(room, tr("Exam: no hints, no distances, no target drawn. It counts."),
                     Type::small, colour::kDim, true);
    } else if (input.attempt) {
        room.take_top(4);
        draw_hints(ui, room, input, true, request);
    }
    return request;
}

}  // namespace sonocase::runtime::inline player_ui
