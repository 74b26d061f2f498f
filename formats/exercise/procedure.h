// SPDX-License-Identifier: Apache-2.0

// A procedure as data: the steps of an exercise from the first look to the last, the acts that a
// trainee performs beside moving probe and needle, and the checklist that is kept of them. Read
// with the exercise from its TOML (docs/procedures.md). The state machine that follows a session
// through it is formats/scoring/procedure_run.h.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/recording/acts.h"

namespace sonocase {

class TomlTable;
struct Exercise;
struct Label;

// What must hold. Everything that is given must hold at the same time; a region is the name of a
// target, a finding or a label, "body", or the beginning of labels' names with * ("lung*").
struct Condition {
    std::vector<std::string> shows;   // each is in the picture, not behind bone or gas
    double shows_at_least = 0.01;     // of the picture, for each; a target shows by its middle
    std::vector<std::string> tip_in;  // the needle's tip is in one of these
    std::vector<std::string> tip_not_in;
    // -1: not asked for; 0: must not; 1: must.
    int needle_in = -1, tip_in_view = -1, probe_on_skin = -1, wire_in = -1;
    double depth_at_least_mm = -1, depth_at_most_mm = -1;  // inserted length; negative: any
    double force_at_least_n = -1, vein_open_at_most = -1;
    double drained_at_least = -1;    // share of the collection's volume, [0, 1]
    std::vector<std::string> taken;  // the last core holds ...
    double taken_at_least_mm = 0;    // ... this much of these together
    std::string aspirated;           // what the last aspiration gave: blood, bile, ..., nothing
    std::string step;                // a step that has been performed before
    std::string complication;        // that has happened
    int act = -1;                    // an ActKind, performed while all the rest holds
    double at_least = 0;             // sum of its amounts; compress: seconds
    double at_most = 1e9;            // likewise: more does not count
    double hold_s = 0;               // how long all of it must hold without a break
    bool given = false;              // the file has it
    friend bool operator==(const Condition&, const Condition&) = default;
};

struct ProcedureStep {
    std::string name, title, instruction;
    Condition entry, done;
    std::string group;  // steps of one group may be performed in any order
};

enum class ItemRule : std::uint8_t {
    step,   // the step was performed, in its order
    when,   // the condition held at some time
    never,  // the condition never held
    asked,  // the trainee's answer is right
};

struct ProcedureItem {
    std::string name, title, source;
    bool critical = false;
    double weight = 1;
    ItemRule rule = ItemRule::step;
    int step = -1;
    Condition condition;
    // asked
    std::string question;
    std::vector<std::string> options;
    int answer = 0;           // index of the right option
    std::string finding;      // `answer` is right where the attempt has this finding ...
    int answer_without = -1;  // ... and this one where it does not
    int from_step = -1;       // asked once this step has been performed; -1: from the start
};

struct Procedure {
    std::vector<ProcedureStep> steps;
    std::vector<ProcedureItem> items;
    double cut = 0;  // points that pass, beside all critical items
    // Injections, throws, wires, dilators and catheters that no step asks for where they are done;
    // more of them fail. Whoever tries everything everywhere must not come upon the right place.
    int stray_acts_at_most = 3;
    std::string source;       // of the list as a whole
    double depth_mm = 150;    // to which a picture counts as seen: the probe's, as written
    bool free_fluid = false;  // the exercise has some, which is drained by the bag
    bool given() const { return !steps.empty() || !items.empty(); }
    double points() const;  // sum of the items' weights
};

// What acts have changed in the tissue, for the picture; places at rest, frame `mannequin`.
struct SceneChange {
    static constexpr int kMaxPools = 6, kMaxTargets = 8, kMaxFluids = 4;
    struct Pool {  // a ball of fluid between the tissue
        Point3 centre;
        double radius_mm = 0;
        bool blood = false;  // fresh blood, with echoes; otherwise clear
    };
    struct Line {  // a wire or a catheter: from the skin to where it turns, and on to its end
        bool in = false;
        Point3 from, turn, to;
    };
    std::array<Pool, kMaxPools> pools{};
    int pool_count = 0;
    // Radius of the first targets over that as drawn: they shrink as they are drained.
    std::array<double, kMaxTargets> target_scale{1, 1, 1, 1, 1, 1, 1, 1};
    Line wire, catheter;
    struct Air {  // a pneumothorax: between lung and chest wall within this distance
        Point3 centre;
        double radius_mm = 0;
    } air;
    struct Level {  // the surface of a free fluid
        Vector3 up{0, 1, 0};
        double mm = 0;  // above the fluid's centre
    };
    std::array<Level, kMaxFluids> levels{};  // of the exercise's
    int level_count = 0;
    // How full the veins are: outward shift of their walls, and the pressure in them; 0: that of
    // the exercise.
    double vein_wall_mm = 0, venous_pressure_mmhg = 0;
};

inline constexpr int kMaxSteps = 32, kMaxItems = 64;

// Reads [procedure], [[steps]] and [[items]] of an exercise. Faults go to the table.
Procedure read_procedure(const TomlTable& root, const Exercise& exercise);

// The first region that is neither a target or finding of the exercise nor a label; empty: none.
std::string unknown_region(const Exercise& exercise, const std::vector<Label>& labels);

// True if `region` names this label: itself, or by its beginning and *.
bool region_names_label(std::string_view region, std::string_view label);

// What lies ready for a trainee: each act that steps and items ask for, in the portions in which a
// hand does it, and what undoes it. In the order of ActKind; without questions.
struct TrayAct {
    Act act;
    const char* words;  // "Inject 1 ml"
};
std::vector<TrayAct> procedure_tray(const Procedure& procedure);

// What can go wrong, in the order of ComplicationKind (formats/scoring/procedure_run.h).
const std::vector<std::string>& complication_names();
std::span<const char* const> complication_titles();  // as a clinician writes them
// What a syringe can draw: "nothing", "blood", "urine", "bile", "fluid", "pus", "air".
const std::vector<std::string>& aspirate_names();

}  // namespace sonocase
