// SPDX-License-Identifier: Apache-2.0

// Follows a session through the procedure of its exercise (formats/exercise/procedure.h): which
// step is present, which have been performed, what the acts did, which items of the checklist are
// ticked, what went wrong. A function of the recorded samples alone: the engine runs it live, the
// score runs it over the recording, and both come to the same list with the same moments.
//
// A step is performed when, after its entry conditions have held, its `done` conditions hold. A
// step whose `done` waits for an act is performed once, at the first time; a step that waits for a
// state can be performed again once its entry has held again. Steps that are performed out of order
// do not count: of all that was performed, in time, the longest chain of steps in the order of the
// file counts, and of chains of the same length the one that was performed first. A step of the
// file that is performed but not in the chain came too early if a later step of the chain follows
// it in time but an earlier one does too; otherwise too late.
//
// What acts do (all figures assumed unless said otherwise):
//   inject      a ball of fluid in the tissue at the tip, at rest, volume kept; what is injected
//               within 3 mm of a ball goes into it. Nothing goes into bone; in a vessel it is
//               carried away and named as a complication
//   aspirate    draws what the tip is in: blood, urine (also of a calyx), bile, pus (an abscess),
//               fluid (a cyst), air (lung, gas); from a collection it takes the volume away. A vein
//               that the probe closes to a tenth gives nothing
//   core_throw  takes what lies along the next 15 or 22 mm, looked up every half millimetre, and
//               the targets without a look of their own that it passes; a vessel in it bleeds
//   wire        is in once the tip is in the body; withdrawn when all of it is drawn back. All
//               but 50 mm of its 450 mm inside: lost. In a vessel or a collection it turns at the
//               tip to where that is longest; elsewhere it goes on straight
//   dilate      over the wire
//   catheter    over the wire, or over the needle where there is no wire; lies at the tip
//   drain       lets fluid out of the collection that catheter or tip lie in, as long as there is
//               any
//   tilt        head down by degrees: veins of the neck fill (formats/exercise/motion.h)
//   valsalva    the patient strains: they fill more
//   turn        onto the left side by degrees; free fluid runs to where is lowest now, as with tilt
//   compress    counts the seconds; bleeding stops after 30 s of it
// Bleeding gives 0.2 ml/s into a pool, at most 60 ml.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/recording/session.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/free_fluid.h"
#include "formats/scoring/sight.h"

namespace sonocase {

enum class ComplicationKind : std::uint8_t {
    pneumothorax,         // tip or throw in lung
    artery_punctured,     // tip or throw in an artery
    through_and_through,  // out of a collection or a vein on its far side
    bowel_punctured,
    gallbladder_punctured,
    bleeding,  // from a vessel in a core throw, or from a dilated artery
    wire_lost,
    artery_dilated,
    intravascular_injection,
};
inline constexpr int kComplications = 9;

enum class StepState : std::uint8_t { waiting, present, done, too_early, too_late, missed };

// What the state machine knows of the session.
struct ProcedureState {
    struct Step {
        bool entered = false;      // its entry has held
        bool counts = false;       // it is in the chain
        bool performed = false;    // at all
        double done_s = -1;        // the moment that counts; otherwise the last one
        double amount = 0;         // of its act so far
        double held_since_s = -1;  // of hold_s
        bool held = false;         // `done` held in the sample before
    };
    struct Item {
        bool held = false;  // `when`, `never`: the condition has held; asked: it is answered
        double at_s = -1;
        double amount = 0, held_since_s = -1;
        int answer = -1;
    };
    struct Pool {
        Point3 centre;  // at rest
        double ml = 0;
        bool blood = false;
    };
    struct Taken {
        int label = 0;  // of the case; -1 - target for a target or finding
        double mm = 0;
    };
    static constexpr int kMaxTaken = 8;

    std::array<Step, kMaxSteps> steps{};
    std::array<Item, kMaxItems> items{};
    std::array<double, kComplications> complication_s{-1, -1, -1, -1, -1, -1, -1, -1, -1};

    std::array<Pool, SceneChange::kMaxPools> pools{};
    int pool_count = 0;
    double injected_ml = 0;       // into tissue
    double injected_lost_ml = 0;  // into bone, air and vessels
    double aspirated_ml = 0, drained_ml = 0, bled_ml = 0;
    int aspirated = 0;  // index of aspirate_names(), of the last aspiration; -1: none yet
    int throws = 0;
    int stray_acts = 0;                    // of an invasive kind, where no step asks for them
    std::array<Taken, kMaxTaken> taken{};  // by the last throw, in order from the tip
    int taken_count = 0;
    double wire_mm = 0;
    bool wire_in = false, catheter_in = false;
    int wire_label = 0;
    // At any moment so far: what was not done cannot have gone well either.
    bool needle_was_in = false, wire_was_in = false, probe_was_on_skin = false;
    double compressed_s = 0, bleeding_compressed_s = 0;
    bool compressing = false;
    double head_down_deg = 0;  // of the table
    bool strains = false;      // against closed lips
    double turned_deg = 0;     // of the patient, onto the left side
    int bleeding_pool = -1;
    SceneChange::Air air;  // of a pneumothorax, around the place at rest where the lung was hit
};

// What a screen shows of it; a value, so that it can cross threads with its frame.
struct ProcedureView {
    int present_step = -1;  // ProcedureRun::present_step()
    std::array<StepState, kMaxSteps> steps{};
    int question = -1;  // next_question()
    ProcedureState state;
};

// The first item behind `after` that is asked now and has no answer; -1: none.
int next_question(const Procedure& procedure, const ProcedureState& state, int after = -1);

// procedure_tray() without what is done already: no second hand presses, no drain lies twice.
std::vector<TrayAct> tray_now(const Procedure& procedure, const ProcedureState& state);

struct ProcedureResult {
    struct Step {
        std::string name, title;
        StepState state = StepState::missed;
        double time_s = -1;
    };
    struct Item {
        std::string name, title, source;
        bool critical = false, ticked = false;
        double weight = 1;
        double time_s = -1;  // of the moment that ticked it, or spoilt it; negative: none
        std::string why;     // where not ticked: not_done, too_early, too_late, happened,
                             // not_tried, wrong_answer, not_answered
    };
    struct Happened {
        std::string name;
        double time_s = 0;
    };
    std::vector<Step> steps;
    std::vector<Item> items;
    std::vector<Happened> complications;  // in order of time
    struct Taken {
        std::string region;
        double mm = 0;
    };
    std::vector<Taken> taken;
    double points = 0, cut = 0, max_points = 0;
    double injected_ml = 0, aspirated_ml = 0, drained_ml = 0, bled_ml = 0;
    int stray_acts = 0, stray_acts_at_most = 0;
    bool passed = true;  // all critical items, the cut, and no more stray acts than allowed
};

// Why an item is not ticked (Item::why), for people: "Too early".
const char* missed_words(std::string_view why);

class ProcedureRun {
  public:
    // The exercise is copied; the picture counts as seen to the depth that it was written with,
    // whatever the console shows. anatomy is kept and may be null: then no region but targets is
    // known, and the body has no inside. Without a procedure the run does nothing.
    ProcedureRun(const Exercise& exercise,
                 std::shared_ptr<const Anatomy> anatomy,
                 const std::vector<Label>& labels);
    void begin();  // as if nothing had been done yet

    bool given() const { return !exercise_->procedure.steps.empty() || has_items_; }

    // Takes the next sample: probe, drawn needle, press and acts. Allocates nothing. Cost: nothing
    // without a procedure; otherwise one walk along the needle and, while a step or item waits for
    // a region in the picture, 520 look-ups, or 3,120 where one is small.
    void update(double time_s,
                bool probe_ok,
                const Rigid& mannequin_from_probe,
                bool needle_ok,
                const Rigid& mannequin_from_drawn,
                bool has_press,
                const PressSample& press,
                const ActList& acts,
                bool unseen = false);  // SessionSample::unseen
    void update(const SessionSample& sample);

    const ProcedureState& state() const { return state_; }
    // The step that the card shows: the first that neither counts nor precedes one that does; -1:
    // all are behind.
    int present_step() const;
    StepState step_state(int step) const;
    // A `never` is ticked only where what it guards against could have happened: whoever inserts
    // nothing spares nothing.
    bool item_ticked(int item) const;
    ProcedureView view() const;  // constant time for a given procedure; allocates nothing
    // Items and steps that changed in the last sample, as bits.
    std::uint32_t new_steps() const { return new_steps_; }
    std::uint32_t new_complications() const { return new_complications_; }

    SceneChange scene() const;
    double volume_ml(int target) const;  // what a collection still holds
    double free_fluid_ml() const;        // of all
    // `ended`: what waits still is missed.
    ProcedureResult result() const;
    std::vector<ProcedureResult::Taken> taken() const;  // by the last throw

  private:
    struct Regions {  // names of a condition, resolved
        std::bitset<256> labels;
        std::uint64_t targets = 0;
        bool body = false;
        bool empty = true;
    };
    struct Watch {
        Condition condition;
        std::vector<Regions> shows;
        Regions tip_in, tip_not_in, taken;
        int step = -1, aspirated = -1, complication = -1;
    };
    struct Performance {
        int step = 0;
        double time_s = 0;
    };
    struct Facts;

    Regions resolve(const std::vector<std::string>& names, const std::vector<Label>& labels) const;
    Watch watch(const Condition& condition, const std::vector<Label>& labels) const;
    void look(const Facts& facts);
    bool in(const Regions& regions, const Facts& facts) const;
    bool tried(const Watch& watch) const;
    bool shown(const Regions& regions, double at_least, const Facts& facts);
    bool holds(const Watch& watch, const Facts& facts);
    // Whether the condition is fulfilled now, with its act and its hold_s.
    bool fulfilled(const Watch& watch, const Facts& facts, double& amount, double& since_s);
    void act(const Act& act, const Facts& facts);
    void count_stray_acts(const Facts& facts);
    void inject(double ml, const Facts& facts);
    void show_pools(SceneChange& out) const;
    // Where the tissue that is now at p lies at rest: less breathing, and less what pools push.
    Point3 tissue_at(Point3 p, double time_s) const;
    void aspirate(double ml, const Facts& facts);
    void core_throw(double mm, const Facts& facts);
    void bleed(Point3 rest, double time_s);
    void hit_lung(Point3 rest, double time_s);
    Point3 wire_end(const Facts& facts, double mm) const;
    // Which free fluid a region is; -1: none.
    int fluid_of(std::size_t region) const {
        return region < first_fluid_ ? -1 : static_cast<int>(region - first_fluid_);
    }
    bool contains(std::size_t region, Point3 rest, int label) const;
    void settle_fluids();
    int collection(const Facts& facts) const;
    void happened(ComplicationKind kind, double time_s);
    void watch_needle(const Facts& facts);
    void perform(int step, double time_s);
    void find_chain();
    int rank(int step) const { return rank_[static_cast<std::size_t>(step)]; }

    std::shared_ptr<const Exercise> exercise_;
    std::shared_ptr<const Anatomy> anatomy_;
    NeedleSight sight_;
    Probe probe_;
    bool has_items_ = false, looks_closely_ = false;
    std::vector<Watch> entry_, done_, item_;
    std::vector<int> rank_;
    std::vector<Target> regions_;  // targets, findings, free fluids
    std::size_t first_fluid_ = 0;  // of regions_
    struct Fluid {
        FreeFluidPlace place;
        SceneChange::Level level;
        double settled_ml = -1;
        int seen = 0;  // looked-up points in it
    };
    std::vector<Fluid> fluids_;
    double settled_turn_deg_ = 0, settled_tilt_deg_ = 0;
    enum Kind : std::uint8_t { kSoft, kLung, kArtery, kVein, kBowel, kBile, kUrine, kBone, kGas };
    std::array<Kind, 256> kind_{};
    std::vector<double> left_ml_, full_ml_;  // of regions_ that hold fluid
    std::vector<std::string> names_;         // of the labels

    ProcedureState state_;
    std::vector<Performance> performances_;
    std::array<std::uint16_t, 256> seen_{};  // looked-up points with this label, in this sample
    int looked_ = 0;
    bool looked_now_ = false;
    SceneChange::Line wire_, catheter_;
    SceneChange pushed_;  // its pools alone: as the present sample found them
    int catheter_region_ = -1;
    // Of the collection or vein that the tip was in last.
    int last_region_ = -1, last_vein_ = 0;
    double last_depth_mm_ = 0;
    bool started_ = false;
    double last_s_ = 0;
    std::uint32_t new_steps_ = 0, new_complications_ = 0;
};

// The result of a recorded session; nothing where the exercise has no procedure.
std::optional<ProcedureResult> procedure_result(const Session& session,
                                                const Exercise& exercise,
                                                const Anatomy* anatomy,
                                                const std::vector<Label>& labels);

const char* step_state_name(StepState state);

}  // namespace sonocase
