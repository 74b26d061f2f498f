// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/procedure.h"

#include <algorithm>

#include "formats/exercise/exercise.h"
#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"
#include "formats/text/toml_reader.h"
#include "formats/volume/label_volume.h"

namespace sonocase {
namespace {

void read_flag(const TomlTable& table, std::string_view key, int& to) {
    bool on = false;
    if (table.flag(key, on)) to = on ? 1 : 0;
}

int step_called(const Procedure& procedure, std::string_view name) {
    for (std::size_t i = 0; i < procedure.steps.size(); ++i)
        if (procedure.steps[i].name == name) return static_cast<int>(i);
    return -1;
}

std::string nearest_step(const Procedure& procedure, const std::string& name) {
    std::vector<std::string> names;
    for (const ProcedureStep& step : procedure.steps) names.push_back(step.name);
    const std::string nearest = nearest_name(name, names);
    return nearest.empty() ? "expected the name of an earlier [[steps]]"
                           : "did you mean '" + nearest + "'?";
}

// A condition that contradicts itself never holds. `acts`: it may wait for an act.
Condition read_condition(const TomlTable& table, const Procedure& procedure, bool acts) {
    Condition c;
    c.given = true;
    table.texts("shows", c.shows, true);
    if (table.number("shows_at_least", c.shows_at_least, 0.0002, 1) && c.shows.empty())
        table.add_fault("shows_at_least", "has no region", "expected shows = \"...\" beside it");
    table.texts("tip_in", c.tip_in, true);
    table.texts("tip_not_in", c.tip_not_in, true);
    read_flag(table, "needle_in", c.needle_in);
    read_flag(table, "tip_in_view", c.tip_in_view);
    read_flag(table, "probe_on_skin", c.probe_on_skin);
    read_flag(table, "wire_in", c.wire_in);
    table.number("depth_at_least_mm", c.depth_at_least_mm, 0, 500);
    table.number("depth_at_most_mm", c.depth_at_most_mm, 0, 500);
    table.number("force_at_least_n", c.force_at_least_n, 0, 200);
    table.number("vein_open_at_most", c.vein_open_at_most, 0, 2);
    table.number("drained_at_least", c.drained_at_least, 0, 1);
    table.texts("taken", c.taken, true);
    table.number("taken_at_least_mm", c.taken_at_least_mm, 0, 50, true);
    if (c.taken.empty() != (c.taken_at_least_mm <= 0))
        table.add_fault("taken", "and taken_at_least_mm belong together", "expected both or none");
    table.text("aspirated", c.aspirated, aspirate_names());
    table.text("complication", c.complication, complication_names());
    table.text("step", c.step);
    if (!c.step.empty() && step_called(procedure, c.step) < 0)
        table.add_fault("step", "'" + c.step + "' is not an earlier step",
                        nearest_step(procedure, c.step));
    if (const auto act = table.choice("act", act_names())) c.act = static_cast<int>(*act);
    table.number("at_least", c.at_least, 0, 1e5);
    table.number("at_most", c.at_most, 0, 1e5);
    table.number("hold_s", c.hold_s, 0, 600);
    if (c.act >= 0 && !acts)
        table.add_fault("act", "is in a condition that is a state",
                        "expected acts in `done` of a step, or in `when` or `never` of an item");
    if (c.act < 0 && (table.has("at_least") || table.has("at_most")))
        table.add_fault("at_least", "has no act", "expected act = \"...\" beside it");
    if (c.at_least > c.at_most)
        table.add_fault("at_least", "is above at_most", "such a condition never holds");
    if (c.depth_at_least_mm >= 0 && c.depth_at_most_mm >= 0 &&
        c.depth_at_least_mm > c.depth_at_most_mm)
        table.add_fault("depth_at_least_mm", "is above depth_at_most_mm",
                        "such a condition never holds");
    if (c.needle_in == 0 && (!c.tip_in.empty() || c.depth_at_least_mm > 0 || c.tip_in_view == 1))
        table.add_fault("needle_in", "is false, and the needle must be somewhere inside",
                        "such a condition never holds");
    for (const std::string& region : c.tip_in)
        if (std::count(c.tip_not_in.begin(), c.tip_not_in.end(), region) > 0)
            table.add_fault("tip_in", "and tip_not_in both name '" + region + "'",
                            "such a condition never holds");
    if (c.act >= 0 && c.hold_s > 0)
        table.add_fault("hold_s", "is given beside an act", "an act is over at once; keep one");
    table.finish();
    return c;
}

// The state that a condition asks for, without its act and its duration.
Condition state_of(const Condition& c) {
    Condition state = c;
    const Condition none;
    state.act = none.act;
    state.at_least = none.at_least;
    state.at_most = none.at_most;
    state.hold_s = none.hold_s;
    state.given = none.given;
    return state;
}

bool says_nothing(const Condition& c) {
    return c.act < 0 && state_of(c) == Condition{};
}

// A step that is over in the state in which it begins would be over before it begins.
bool done_before_entry(const Condition& entry, const Condition& done) {
    return done.act < 0 && done.hold_s == 0 && state_of(entry) == state_of(done);
}

template <class List>
void need_new_name(const TomlTable& table, const std::string& name, const List& earlier) {
    if (name.empty())
        table.add_fault("name", "is missing or empty", "expected a short name, as in \"scan\"");
    for (const auto& other : earlier)
        if (!name.empty() && other.name == name)
            table.add_fault("name", "'" + name + "' is given twice", "");
}

void read_step(const TomlTable& table, Procedure& procedure) {
    ProcedureStep step;
    table.text("name", step.name);
    need_new_name(table, step.name, procedure.steps);
    step.title = step.name;
    table.text("title", step.title);
    table.text("instruction", step.instruction);
    table.text("group", step.group);
    if (auto entry = table.table("entry")) step.entry = read_condition(*entry, procedure, false);
    if (auto done = table.table("done")) step.done = read_condition(*done, procedure, true);
    if (says_nothing(step.done))
        table.add_fault("done", "is missing or empty", "a step without it can never end");
    else if (step.entry.given && done_before_entry(step.entry, step.done))
        table.add_fault("done", "is what entry asks for", "such a step ends before it begins");
    if (!step.entry.step.empty() && step.entry.step == step.name)
        table.add_fault("entry", "waits for the step itself", "expected an earlier step");
    if (procedure.steps.size() >= kMaxSteps)
        table.add_fault("name", "is one step too many",
                        "expected at most " + std::to_string(kMaxSteps));
    else
        procedure.steps.push_back(std::move(step));
    table.finish();
}

void read_question(const TomlTable& table, const Exercise& exercise, ProcedureItem& item) {
    item.rule = ItemRule::asked;
    table.texts("options", item.options);
    if (item.options.size() < 2)
        table.add_fault("options", "has fewer than two", "expected what can be answered");
    const int most = std::max(static_cast<int>(item.options.size()) - 1, 0);
    if (!table.whole("answer", item.answer, 0, most) && !table.has("answer"))
        table.add_fault("answer", "is missing", "expected the number of the right option, from 0");
    table.text("finding", item.finding);
    const bool without = table.whole("answer_without", item.answer_without, 0, most);
    if (without == item.finding.empty())
        table.add_fault("finding", "and answer_without belong together", "expected both or none");
    const auto named = [&](const auto& of) { return of.name == item.finding; };
    if (!item.finding.empty() &&
        std::none_of(exercise.findings.begin(), exercise.findings.end(),
                     [&](const Finding& f) { return named(f.lesion); }) &&
        std::none_of(exercise.free_fluids.begin(), exercise.free_fluids.end(), named))
        table.add_fault("finding", "'" + item.finding + "' is not a finding of the exercise",
                        "expected a name from [[findings]] or [[free_fluid]]");
}

void read_item(const TomlTable& table, const Exercise& exercise, Procedure& procedure) {
    ProcedureItem item;
    table.text("name", item.name);
    need_new_name(table, item.name, procedure.items);
    item.title = item.name;
    table.text("title", item.title);
    table.text("source", item.source);
    table.flag("critical", item.critical);
    table.number("weight", item.weight, 0, 1000, true);
    int rules = 0;
    std::string step;
    if (table.text("step", step)) {
        ++rules;
        item.step = step_called(procedure, step);
        if (item.step < 0)
            table.add_fault("step", "'" + step + "' is not a step", nearest_step(procedure, step));
    }
    for (const auto& [key, rule] :
         {std::pair{"when", ItemRule::when}, std::pair{"never", ItemRule::never}}) {
        if (auto condition = table.table(key)) {
            ++rules;
            item.rule = rule;
            item.condition = read_condition(*condition, procedure, true);
            if (says_nothing(item.condition))
                table.add_fault(key, "is empty", "expected what must hold");
        }
    }
    if (table.text("question", item.question)) {
        ++rules;
        read_question(table, exercise, item);
        std::string after;
        if (table.text("after", after)) {
            item.from_step = step_called(procedure, after);
            if (item.from_step < 0)
                table.add_fault("after", "'" + after + "' is not a step",
                                nearest_step(procedure, after));
        }
    }
    if (rules != 1)
        table.add_fault("name", rules == 0 ? "has no rule" : "has more than one rule",
                        "expected one of step, when, never or question");
    if (procedure.items.size() >= kMaxItems)
        table.add_fault("name", "is one item too many",
                        "expected at most " + std::to_string(kMaxItems));
    else
        procedure.items.push_back(std::move(item));
    table.finish();
}

}  // namespace

double Procedure::points() const {
    double sum = 0;
    for (const ProcedureItem& item : items) sum += item.weight;
    return sum;
}

Procedure read_procedure(const TomlTable& root, const Exercise& exercise) {
    Procedure procedure;
    procedure.depth_mm = exercise.probe.depth_mm;
    procedure.free_fluid = !exercise.free_fluids.empty();
    const auto head = root.table("procedure");
    if (head) {
        head->number("cut", procedure.cut, 0, 1e5);
        head->text("source", procedure.source);
        head->whole("stray_acts_at_most", procedure.stray_acts_at_most, 0, 1000);
    }
    for (const TomlTable& table : root.tables("steps")) read_step(table, procedure);
    for (const TomlTable& table : root.tables("items")) read_item(table, exercise, procedure);
    if (head) {
        if (!procedure.given())
            head->add_fault("cut", "stands alone", "expected [[steps]] and [[items]]");
        else if (procedure.cut > procedure.points())
            head->add_fault(
                "cut", "is above the sum of all weights, " + number_text(procedure.points(), 6),
                "nobody could pass");
        head->finish();
    }
    return procedure;
}

std::string unknown_region(const Exercise& exercise, const std::vector<Label>& labels) {
    const auto known = [&](const std::string& region) {
        if (region == "body") return true;
        for (const FreeFluid& fluid : exercise.free_fluids)
            if (fluid.name == region) return true;
        for (const Target& target : exercise.targets)
            if (target.name == region) return true;
        for (const Finding& finding : exercise.findings)
            if (finding.lesion.name == region) return true;
        for (std::size_t l = 1; l < labels.size(); ++l)
            if (region_names_label(region, labels[l].name)) return true;
        return false;
    };
    const auto first = [&](const Condition& c) -> std::string {
        for (const auto* regions : {&c.shows, &c.tip_in, &c.tip_not_in, &c.taken})
            for (const std::string& region : *regions)
                if (!known(region)) return region;
        return {};
    };
    for (const ProcedureStep& step : exercise.procedure.steps)
        for (const Condition* c : {&step.entry, &step.done})
            if (const std::string region = first(*c); !region.empty()) return region;
    for (const ProcedureItem& item : exercise.procedure.items)
        if (const std::string region = first(item.condition); !region.empty()) return region;
    return {};
}

namespace {
constexpr double kDrainMl = 5, kDrainBagMl = 250;  // of a collection; of the abdomen
}

std::vector<TrayAct> procedure_tray(const Procedure& procedure) {
    std::array<bool, kActKinds> asked{};
    const auto add = [&](const Condition& c) {
        if (c.act >= 0) asked[static_cast<std::size_t>(c.act)] = true;
        if (!c.aspirated.empty()) asked[static_cast<std::size_t>(ActKind::aspirate)] = true;
        if (!c.taken.empty()) asked[static_cast<std::size_t>(ActKind::core_throw)] = true;
        if (c.wire_in >= 0) asked[static_cast<std::size_t>(ActKind::wire)] = true;
        if (c.drained_at_least >= 0) asked[static_cast<std::size_t>(ActKind::drain)] = true;
    };
    for (const ProcedureStep& step : procedure.steps)
        for (const Condition* c : {&step.entry, &step.done}) add(*c);
    for (const ProcedureItem& item : procedure.items) add(item.condition);
    // Two ways to the same end: whoever may tip the table may ask the patient to strain.
    bool &tilt = asked[static_cast<std::size_t>(ActKind::tilt)],
         &strain = asked[static_cast<std::size_t>(ActKind::valsalva)];
    tilt = strain = tilt || strain;
    static const TrayAct kAll[] = {{{ActKind::inject, 0, 1}, "Inject 1 ml"},
                                   {{ActKind::aspirate, 0, 1}, "Draw back 1 ml"},
                                   {{ActKind::core_throw, 0, 15}, "Throw 15 mm"},
                                   {{ActKind::core_throw, 0, 22}, "Throw 22 mm"},
                                   {{ActKind::wire, 0, 20}, "Wire in 2 cm"},
                                   {{ActKind::wire, 0, -20}, "Wire back 2 cm"},
                                   {{ActKind::dilate, 0, 1}, "Dilator"},
                                   {{ActKind::catheter, 0, 1}, "Catheter in"},
                                   {{ActKind::catheter, 0, 0}, "Catheter out"},
                                   {{ActKind::drain, 0, kDrainMl}, "Drain 5 ml"},
                                   {{ActKind::drain, 0, kDrainBagMl}, "Drain 250 ml"},
                                   {{ActKind::compress, 0, 1}, "Press on it"},
                                   {{ActKind::compress, 0, 0}, "Let go"},
                                   {{ActKind::rescan, 0, 1}, "I looked again"},
                                   {{ActKind::tilt, 0, 15}, "Head down 15 degrees"},
                                   {{ActKind::tilt, 0, 0}, "Table level"},
                                   {{ActKind::valsalva, 0, 1}, "Ask to strain"},
                                   {{ActKind::valsalva, 0, 0}, "Breathe again"},
                                   {{ActKind::turn, 0, 30}, "Turn to the left"},
                                   {{ActKind::turn, 0, 0}, "On the back again"}};
    std::vector<TrayAct> tray;
    const double other_drain_ml = procedure.free_fluid ? kDrainMl : kDrainBagMl;
    for (const TrayAct& one : kAll) {
        if (one.act.kind == ActKind::drain && one.act.amount == other_drain_ml) continue;
        if (asked[static_cast<std::size_t>(one.act.kind)]) tray.push_back(one);
    }
    return tray;
}

bool region_names_label(std::string_view region, std::string_view label) {
    if (!region.empty() && region.back() == '*')
        return label.substr(0, region.size() - 1) == region.substr(0, region.size() - 1);
    return region == label;
}

const std::vector<std::string>& complication_names() {
    static const std::vector<std::string> names{
        "pneumothorax",    "artery_punctured",      "through_and_through",
        "bowel_punctured", "gallbladder_punctured", "bleeding",
        "wire_lost",       "artery_dilated",        "intravascular_injection"};
    return names;
}

std::span<const char* const> complication_titles() {
    static constexpr const char* kTitles[] = {
        "Pneumothorax",    "Artery punctured",       "Punctured through and through",
        "Bowel punctured", "Gall bladder punctured", "Bleeding",
        "Guide wire lost", "Artery dilated",         "Anaesthetic injected into a vessel"};
    return kTitles;
}

const std::vector<std::string>& aspirate_names() {
    static const std::vector<std::string> names{"nothing", "blood", "urine", "bile",
                                                "fluid",   "pus",   "air"};
    return names;
}

}  // namespace sonocase
