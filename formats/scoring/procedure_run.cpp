// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/procedure_run.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "formats/base/constants.h"
#include "formats/base/portable_math.h"
#include "formats/exercise/motion.h"
#include "formats/exercise/pool_shift.h"
#include "formats/scoring/session_monitor.h"
#include "formats/text/number_text.h"
#include "formats/volume/tissue.h"

namespace sonocase {
namespace {

constexpr double kTargetSlabMm = 5;  // as ScoreOptions::target_slab_mm
constexpr int kLookLines = 13, kLookRows = 40;
// Where a condition asks for less of the picture than this, the points lie closer: 2.5 by 1.4 mm in
// a curved probe's picture of 110 mm, so that an artery of 3 mm is not missed.
constexpr double kSmallShare = 0.001;
constexpr int kFineLines = 39, kFineRows = 80;
constexpr double kPoolReachMm = 3;
constexpr double kThrowStepMm = 0.5;
constexpr double kWireMm = 450, kWireHeldMm = 50;
constexpr double kShownWireMm = 60;  // drawn beyond the tip, at most
constexpr double kBleedMlS = 0.2, kMaxBledMl = 60, kStopBleedingS = 30;
// Air that leaks from a lung spreads this fast, and this far (a).
constexpr double kAirMmS = 6, kMaxAirMm = 60;
constexpr double kLongestStepS = 1;  // time of acts that last does not run on across a gap
constexpr double kClosedVein = 0.1;  // share of its area at rest
constexpr double kBeyondMm = 1;      // deeper than a collection's far side
constexpr std::size_t kMaxPerformances = 128;

double ball_ml(double radius_mm) {
    return 4.0 / 3 * kPi * radius_mm * radius_mm * radius_mm / 1000;
}
double ball_radius_mm(double ml) {
    return std::cbrt(3 * ml * 1000 / (4 * kPi));
}

// As the recording keeps it, so that live and recorded runs compare the same number.
double as_recorded(double value) {
    double read = value;
    return parse_number(number_text(value, 6), read) ? read : value;
}

// A console's depth may have been put into the exercise.
std::shared_ptr<const Exercise> as_written(const Exercise& exercise) {
    auto copy = std::make_shared<Exercise>(exercise);
    if (exercise.procedure.given()) copy->probe.depth_mm = exercise.procedure.depth_mm;
    return copy;
}

}  // namespace

// One sample, and what is worked out from it.
struct ProcedureRun::Facts {
    double time_s = 0, dt_s = 0;
    bool probe_ok = false, needle_ok = false, unseen = false;
    Rigid probe, needle;
    Point3 tip, tip_rest;
    Vector3 direction;
    double depth_mm = 0;  // 0: outside
    Point3 skin;
    int label = 0;    // the tip is in
    int region = -1;  // the smallest target or finding that the tip is in
    bool on_skin = false, tip_in_view = false;
    bool has_press = false;
    double force_n = 0, vein_open = -1;
    const ActList* acts = nullptr;
    double act_sum[kActKinds] = {};  // amounts of this sample
    bool act_any[kActKinds] = {};
};

ProcedureRun::ProcedureRun(const Exercise& exercise,
                           std::shared_ptr<const Anatomy> anatomy,
                           const std::vector<Label>& labels)
    : exercise_(as_written(exercise)),
      anatomy_(std::move(anatomy)),
      sight_(anatomy_.get(), *exercise_),
      probe_(exercise_->probe),
      has_items_(!exercise_->procedure.items.empty()) {
    if (!given()) return;
    const Procedure& p = exercise_->procedure;
    regions_ = exercise_->targets;
    for (const Finding& finding : exercise_->findings) regions_.push_back(finding.lesion);
    for (const Target& region : regions_) {
        const bool fluid = region.look == TargetLook::cyst || region.look == TargetLook::abscess ||
                           region.look == TargetLook::calyx;
        full_ml_.push_back(fluid ? ball_ml(region.radius_mm) : 0);
    }
    first_fluid_ = regions_.size();
    for (const FreeFluid& free : exercise_->free_fluids) {
        if (!anatomy_) break;
        FreeFluidPlace place(
            free, [&](Point3 at) { return anatomy_->label(at); }, labels);
        full_ml_.push_back(std::min(free.ml, place.capacity_ml()));
        fluids_.push_back({std::move(place), {}});
        Target fluid;
        fluid.name = free.name;
        fluid.centre = free.centre;
        regions_.push_back(std::move(fluid));
    }
    for (std::size_t l = 0; l < labels.size() && l < kind_.size(); ++l) {
        const std::string& tissue = labels[l].tissue;
        names_.push_back(labels[l].name);
        kind_[l] = tissue == "lung"    ? kLung
                   : tissue == "gas"   ? kGas
                   : tissue == "bone"  ? kBone
                   : tissue == "bowel" ? kBowel
                   : tissue == "bile"  ? kBile
                   : tissue == "urine" ? kUrine
                                       : kSoft;
        if (tissue == "blood")
            kind_[l] = vessel_of_label(labels[l].name) == Vessel::vein ? kVein : kArtery;
    }
    for (const ProcedureStep& step : p.steps) {
        entry_.push_back(watch(step.entry, labels));
        done_.push_back(watch(step.done, labels));
    }
    for (const ProcedureItem& item : p.items) item_.push_back(watch(item.condition, labels));
    for (std::size_t i = 0; i < p.steps.size(); ++i) {
        const bool same =
            i > 0 && !p.steps[i].group.empty() && p.steps[i].group == p.steps[i - 1].group;
        rank_.push_back(same ? rank_[i - 1] : static_cast<int>(i));
    }
    for (const auto* list : {&entry_, &done_, &item_})
        for (const Watch& w : *list)
            looks_closely_ =
                looks_closely_ || (!w.shows.empty() && w.condition.shows_at_least < kSmallShare);
    performances_.reserve(kMaxPerformances);
    begin();
}

void ProcedureRun::begin() {
    state_ = {};
    state_.aspirated = -1;
    left_ml_ = full_ml_;
    performances_.clear();
    wire_ = catheter_ = {};
    catheter_region_ = last_region_ = -1;
    last_vein_ = 0;
    last_depth_mm_ = last_s_ = 0;
    started_ = false;
    new_steps_ = new_complications_ = 0;
    for (Fluid& fluid : fluids_) fluid.settled_ml = -1;
    settle_fluids();
}

// Free fluid runs to where is lowest now.
void ProcedureRun::settle_fluids() {
    const bool moved =
        state_.turned_deg != settled_turn_deg_ || state_.head_down_deg != settled_tilt_deg_;
    settled_turn_deg_ = state_.turned_deg;
    settled_tilt_deg_ = state_.head_down_deg;
    for (std::size_t i = 0; i < fluids_.size(); ++i) {
        Fluid& fluid = fluids_[i];
        const double ml = left_ml_[first_fluid_ + i];
        if (ml == fluid.settled_ml && !moved) continue;
        fluid.settled_ml = ml;
        const Vector3 up = fluid.place.up(state_.turned_deg, state_.head_down_deg);
        fluid.level = {up, fluid.place.level_mm(ml, up)};
    }
}

// label: of the case, at that place.
bool ProcedureRun::contains(std::size_t region, Point3 rest, int label) const {
    if (const int n = fluid_of(region); n >= 0) {
        const Fluid& fluid = fluids_[static_cast<std::size_t>(n)];
        return fluid.place.contains(rest, label, fluid.level.up, fluid.level.mm);
    }
    return distance(regions_[region].centre, rest) <= regions_[region].radius_mm;
}

ProcedureRun::Regions ProcedureRun::resolve(const std::vector<std::string>& names,
                                            const std::vector<Label>& labels) const {
    Regions out;
    out.empty = names.empty();
    for (const std::string& name : names) {
        if (name == "body") out.body = true;
        for (std::size_t r = 0; r < regions_.size() && r < 64; ++r)
            if (regions_[r].name == name) out.targets |= std::uint64_t{1} << r;
        for (std::size_t l = 1; l < labels.size() && l < out.labels.size(); ++l)
            if (region_names_label(name, labels[l].name)) out.labels.set(l);
    }
    return out;
}

ProcedureRun::Watch ProcedureRun::watch(const Condition& condition,
                                        const std::vector<Label>& labels) const {
    Watch out;
    out.condition = condition;
    for (const std::string& region : condition.shows)
        out.shows.push_back(resolve({region}, labels));
    out.tip_in = resolve(condition.tip_in, labels);
    out.tip_not_in = resolve(condition.tip_not_in, labels);
    out.taken = resolve(condition.taken, labels);
    const auto index = [](const std::vector<std::string>& names, const std::string& name) {
        const auto found = std::find(names.begin(), names.end(), name);
        return name.empty() || found == names.end() ? -1 : static_cast<int>(found - names.begin());
    };
    out.aspirated = index(aspirate_names(), condition.aspirated);
    out.complication = index(complication_names(), condition.complication);
    const auto& steps = exercise_->procedure.steps;
    for (std::size_t i = 0; i < steps.size(); ++i)
        if (!condition.step.empty() && steps[i].name == condition.step)
            out.step = static_cast<int>(i);
    return out;
}

// Looks up points of the picture along its lines, each as far as sound comes.
void ProcedureRun::look(const Facts& f) {
    looked_now_ = true;
    seen_.fill(0);
    looked_ = 0;
    for (Fluid& fluid : fluids_) fluid.seen = 0;
    if (!f.probe_ok || !anatomy_) return;
    const int lines = looks_closely_ ? kFineLines : kLookLines,
              rows = looks_closely_ ? kFineRows : kLookRows;
    for (int line = 0; line < lines; ++line) {
        const double part = (line + 0.5) / lines - 0.5;
        Point3 face;
        Vector3 along{0, 0, 1};
        if (probe_.shape == ProbeShape::linear) {
            face.x = part * probe_.width_mm;
        } else {
            const double angle = part * probe_.field_of_view_rad;
            along = {sine(angle), 0, cosine(angle)};
            if (probe_.shape == ProbeShape::curvilinear)
                face = {probe_.radius_mm * along.x, 0, probe_.radius_mm * (along.z - 1)};
        }
        bool blocked = false;
        int air = 0;
        for (int row = 0; row < rows; ++row) {
            ++looked_;
            if (blocked) continue;
            const double depth = (row + 0.5) * probe_.depth_mm / rows;
            const Point3 p = f.probe * (face + depth * along);
            const Point3 rest = tissue_at(p, f.time_s);
            const int label = anatomy_->label(rest);
            if (label == 0) {
                blocked = ++air > rows / 20;  // gel bridges a gap; beyond it is air
                continue;
            }
            const auto fluid = std::find_if(fluids_.begin(), fluids_.end(), [&](const Fluid& one) {
                return one.place.contains(rest, label, one.level.up, one.level.mm);
            });
            if (fluid != fluids_.end())
                ++fluid->seen;
            else
                ++seen_[static_cast<std::size_t>(label)];
            blocked = anatomy_->blocks_sound(label);
        }
    }
}

bool ProcedureRun::in(const Regions& regions, const Facts& f) const {
    if (f.depth_mm <= 0) return false;
    if (regions.body) return true;
    if (f.label > 0 && regions.labels.test(static_cast<std::size_t>(f.label))) return true;
    if (regions.targets == 0) return false;
    for (std::size_t r = 0; r < regions_.size() && r < 64; ++r)
        if ((regions.targets >> r & 1) != 0 && contains(r, f.tip_rest, f.label)) return true;
    return false;
}

bool ProcedureRun::shown(const Regions& regions, double at_least, const Facts& f) {
    if (!f.probe_ok || f.unseen) return false;
    for (std::size_t r = 0; r < regions_.size() && r < 64; ++r) {
        if ((regions.targets >> r & 1) == 0 || fluid_of(r) >= 0) continue;
        const Point3 now =
            anatomy_ ? anatomy_->moved(regions_[r].centre, f.time_s) : regions_[r].centre;
        const Point3 p = inverse(f.probe) * now;
        if (std::abs(p.y) < kTargetSlabMm && in_image(probe_, p.x, p.z) &&
            (!anatomy_ || sound_reaches(*anatomy_, probe_, f.probe, p, f.time_s)))
            return true;
    }
    const std::uint64_t fluids = first_fluid_ < 64 ? regions.targets >> first_fluid_ : 0;
    if (regions.labels.none() && fluids == 0) return false;
    if (!looked_now_) look(f);
    int points = 0;
    for (std::size_t i = 0; i < fluids_.size(); ++i)
        if ((fluids >> i & 1) != 0) points += fluids_[i].seen;
    for (std::size_t l = 1; l < seen_.size(); ++l)
        if (regions.labels.test(l)) points += seen_[l];
    return points > at_least * looked_ && points > 0;
}

// Everything but the act and hold_s.
bool ProcedureRun::holds(const Watch& w, const Facts& f) {
    const Condition& c = w.condition;
    const bool in_body = f.depth_mm > 0;
    if (c.needle_in >= 0 && in_body != (c.needle_in == 1)) return false;
    if (c.probe_on_skin >= 0 && f.on_skin != (c.probe_on_skin == 1)) return false;
    if (c.tip_in_view >= 0 && (in_body && f.tip_in_view) != (c.tip_in_view == 1)) return false;
    if (c.wire_in >= 0 && state_.wire_in != (c.wire_in == 1)) return false;
    if (c.depth_at_least_mm >= 0 && !(in_body && f.depth_mm >= c.depth_at_least_mm)) return false;
    if (c.depth_at_most_mm >= 0 && !(f.depth_mm <= c.depth_at_most_mm)) return false;
    if (c.force_at_least_n >= 0 && !(f.has_press && f.force_n >= c.force_at_least_n)) return false;
    if (c.vein_open_at_most >= 0 &&
        !(f.has_press && f.vein_open >= 0 && f.vein_open <= c.vein_open_at_most))
        return false;
    if (w.aspirated >= 0 && state_.aspirated != w.aspirated) return false;
    if (w.complication >= 0 && state_.complication_s[static_cast<std::size_t>(w.complication)] < 0)
        return false;
    if (w.step >= 0 && !state_.steps[static_cast<std::size_t>(w.step)].performed) return false;
    if (c.drained_at_least >= 0) {
        bool drained = false;
        for (std::size_t r = 0; r < full_ml_.size(); ++r)
            drained = drained ||
                      (full_ml_[r] > 0 && left_ml_[r] <= (1 - c.drained_at_least) * full_ml_[r]);
        if (!drained) return false;
    }
    if (!w.taken.empty) {
        double mm = 0;
        for (int i = 0; i < state_.taken_count; ++i) {
            const ProcedureState::Taken& taken = state_.taken[static_cast<std::size_t>(i)];
            const bool counts =
                taken.label < 0
                    ? (w.taken.targets >> (-1 - taken.label) & 1) != 0
                    : w.taken.body || w.taken.labels.test(static_cast<std::size_t>(taken.label));
            if (counts) mm += taken.mm;
        }
        if (mm < c.taken_at_least_mm) return false;
    }
    if (!w.tip_in.empty && !in(w.tip_in, f)) return false;
    if (!w.tip_not_in.empty && in(w.tip_not_in, f)) return false;
    for (const Regions& regions : w.shows)
        if (!shown(regions, c.shows_at_least, f)) return false;
    return true;
}

bool ProcedureRun::fulfilled(const Watch& w, const Facts& f, double& amount, double& since_s) {
    const Condition& c = w.condition;
    if (c.act >= 0) {
        // Most samples have no act, and then nothing else needs to be looked at.
        const auto kind = static_cast<std::size_t>(c.act);
        const bool lasts = static_cast<ActKind>(c.act) == ActKind::compress;
        if (lasts ? !state_.compressing : !f.act_any[kind]) return false;
        if (!holds(w, f)) return false;
        amount += lasts ? f.dt_s : f.act_sum[kind];
        return amount > 0 && amount >= c.at_least && amount <= c.at_most;
    }
    if (!holds(w, f)) {
        since_s = -1;
        return false;
    }
    if (since_s < 0) since_s = f.time_s;
    return f.time_s - since_s >= c.hold_s;
}

void ProcedureRun::happened(ComplicationKind kind, double time_s) {
    const auto k = static_cast<std::size_t>(kind);
    if (state_.complication_s[k] >= 0) return;
    state_.complication_s[k] = time_s;
    new_complications_ |= 1u << k;
}

void ProcedureRun::bleed(Point3 rest, double time_s) {
    happened(ComplicationKind::bleeding, time_s);
    if (state_.bleeding_pool >= 0) return;
    if (state_.pool_count == SceneChange::kMaxPools) --state_.pool_count;
    state_.bleeding_pool = state_.pool_count++;
    state_.pools[static_cast<std::size_t>(state_.bleeding_pool)] = {rest, 0, true};
    state_.bleeding_compressed_s = 0;
}

void ProcedureRun::hit_lung(Point3 rest, double time_s) {
    if (state_.complication_s[static_cast<std::size_t>(ComplicationKind::pneumothorax)] < 0)
        state_.air.centre = rest;
    happened(ComplicationKind::pneumothorax, time_s);
}

// The collection that catheter or tip lie in; -1: none.
int ProcedureRun::collection(const Facts& f) const {
    if (catheter_region_ >= 0) return catheter_region_;
    if (f.depth_mm <= 0 || f.region < 0) return -1;
    return full_ml_[static_cast<std::size_t>(f.region)] > 0 ? f.region : -1;
}

void ProcedureRun::show_pools(SceneChange& out) const {
    out.pool_count = 0;
    for (int i = 0; i < state_.pool_count; ++i) {
        const ProcedureState::Pool& pool = state_.pools[static_cast<std::size_t>(i)];
        if (pool.ml > 0)
            out.pools[static_cast<std::size_t>(out.pool_count++)] = {
                pool.centre, ball_radius_mm(pool.ml), pool.blood};
    }
}

Point3 ProcedureRun::tissue_at(Point3 p, double time_s) const {
    return before_pools(
        std::span(pushed_.pools).first(static_cast<std::size_t>(pushed_.pool_count)),
        anatomy_->at_rest(p, time_s));
}

void ProcedureRun::inject(double ml, const Facts& f) {
    if (!(ml > 0)) return;
    const Kind kind = kind_[static_cast<std::size_t>(f.label)];
    if (f.depth_mm <= 0 || kind == kBone || kind == kLung || kind == kGas) {
        state_.injected_lost_ml += ml;
        return;
    }
    if (kind == kArtery || kind == kVein) {
        state_.injected_lost_ml += ml;
        happened(ComplicationKind::intravascular_injection, f.time_s);
        return;
    }
    state_.injected_ml += ml;
    if (const int into = f.region;
        into >= 0 && full_ml_[static_cast<std::size_t>(into)] > 0) {  // the collection takes it up
        left_ml_[static_cast<std::size_t>(into)] += ml;
        return;
    }
    int nearest = -1;
    double nearest_mm = INFINITY;
    for (int i = 0; i < state_.pool_count; ++i) {
        const ProcedureState::Pool& pool = state_.pools[static_cast<std::size_t>(i)];
        if (pool.blood) continue;
        const double d = distance(pool.centre, f.tip_rest) - ball_radius_mm(pool.ml);
        if (d < nearest_mm) nearest = i, nearest_mm = d;
    }
    if (nearest < 0 || (nearest_mm > kPoolReachMm && state_.pool_count < SceneChange::kMaxPools)) {
        if (state_.pool_count == SceneChange::kMaxPools) {  // all of them blood
            state_.injected_ml -= ml;
            state_.injected_lost_ml += ml;
            return;
        }
        state_.pools[static_cast<std::size_t>(state_.pool_count++)] = {f.tip_rest, ml, false};
        return;
    }
    ProcedureState::Pool& pool = state_.pools[static_cast<std::size_t>(nearest)];
    const double share = ml / (pool.ml + ml);
    pool.centre = pool.centre + share * (f.tip_rest - pool.centre);
    pool.ml += ml;
}

void ProcedureRun::aspirate(double ml, const Facts& f) {
    const auto gives = [&](const char* name) {
        const auto& names = aspirate_names();
        state_.aspirated =
            static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
    };
    if (const int from = collection(f); from >= 0 && left_ml_[static_cast<std::size_t>(from)] > 0) {
        double& left = left_ml_[static_cast<std::size_t>(from)];
        const double drawn = std::clamp(ml, 0.0, left);
        left -= drawn;
        state_.aspirated_ml += drawn;
        const TargetLook look = regions_[static_cast<std::size_t>(from)].look;
        if (const int n = fluid_of(static_cast<std::size_t>(from)); n >= 0)
            return gives(exercise_->free_fluids[static_cast<std::size_t>(n)].blood ? "blood"
                                                                                   : "fluid");
        return gives(look == TargetLook::abscess ? "pus"
                     : look == TargetLook::calyx ? "urine"
                                                 : "fluid");
    }
    if (f.depth_mm <= 0) return gives(f.needle_ok ? "air" : "nothing");
    switch (kind_[static_cast<std::size_t>(f.label)]) {
        case kVein:  // walls that touch let nothing through
            if (f.has_press && f.vein_open >= 0 && f.vein_open < kClosedVein)
                return gives("nothing");
            [[fallthrough]];
        case kArtery: return gives("blood");
        case kUrine: return gives("urine");
        case kBile: return gives("bile");
        case kLung:
        case kGas: return gives("air");
        default: return gives("nothing");
    }
}

void ProcedureRun::core_throw(double mm, const Facts& f) {
    if (!(mm > 0) || f.depth_mm <= 0 || !anatomy_) return;
    ++state_.throws;
    state_.taken_count = 0;
    mm = std::min(mm, 50.0);
    Point3 bled;
    bool bleeds = false;
    const int count = static_cast<int>(std::lround(mm / kThrowStepMm));
    const auto take = [&](int region) {
        const auto end = state_.taken.begin() + state_.taken_count;
        const auto found =
            std::find_if(state_.taken.begin(), end,
                         [&](const ProcedureState::Taken& t) { return t.label == region; });
        if (found != end)
            found->mm += kThrowStepMm;
        else if (state_.taken_count < ProcedureState::kMaxTaken)
            state_.taken[static_cast<std::size_t>(state_.taken_count++)] = {region, kThrowStepMm};
    };
    for (int i = 0; i < count; ++i) {
        const Point3 now = f.tip + (i + 0.5) * kThrowStepMm * f.direction;
        const Point3 rest = tissue_at(now, f.time_s);
        const int label = anatomy_->label(rest);
        int tissue = label;
        for (std::size_t r = 0; r < regions_.size(); ++r) {
            if (!contains(r, rest, label)) continue;
            if (regions_[r].look == TargetLook::none)
                take(-1 - static_cast<int>(r));  // a place in a tissue, beside that
            else
                tissue = -1 - static_cast<int>(r);
        }
        if (tissue != 0) take(tissue);
        switch (kind_[static_cast<std::size_t>(label)]) {
            case kArtery: happened(ComplicationKind::artery_punctured, f.time_s); [[fallthrough]];
            case kVein:
                if (!bleeds) bled = rest;
                bleeds = true;
                break;
            case kLung: hit_lung(rest, f.time_s); break;
            case kBowel: happened(ComplicationKind::bowel_punctured, f.time_s); break;
            case kBile: happened(ComplicationKind::gallbladder_punctured, f.time_s); break;
            default: break;
        }
        if (kind_[static_cast<std::size_t>(label)] == kBone) break;  // the throw ends at bone
    }
    if (bleeds) bleed(bled, f.time_s);
}

// The end of a wire that is `mm` beyond the tip. The directions tried are those of the half space
// ahead, so that it never turns back on the needle.
Point3 ProcedureRun::wire_end(const Facts& f, double mm) const {
    const Kind kind = kind_[static_cast<std::size_t>(f.label)];
    const bool fluid = f.region >= 0 && full_ml_[static_cast<std::size_t>(f.region)] > 0;
    const bool hollow =
        fluid || kind == kArtery || kind == kVein || kind == kUrine || kind == kBile;
    if (!anatomy_ || !hollow) return f.tip_rest + mm * f.direction;
    const auto inside = [&](Point3 p) {
        if (!fluid) return anatomy_->label(p) == f.label;
        return contains(static_cast<std::size_t>(f.region), p, anatomy_->label(p));
    };
    constexpr double kStepMm = 1, kGoldenAngle = 2.399963229728653;
    constexpr int kDirections = 96;
    const Vector3 x = any_perpendicular(f.direction), y = cross(f.direction, x);
    Point3 end = f.tip_rest;
    double longest = 0;
    for (int i = 0; i < kDirections && longest < mm; ++i) {
        const double ahead = 1 - (i + 0.5) / kDirections, across = std::sqrt(1 - ahead * ahead);
        const Vector3 way = ahead * f.direction +
                            across * (cosine(kGoldenAngle * i) * x + sine(kGoldenAngle * i) * y);
        double length = 0;
        while (length + kStepMm <= mm && inside(f.tip_rest + (length + kStepMm) * way))
            length += kStepMm;
        if (length <= longest) continue;
        longest = length;
        end = f.tip_rest + length * way;
    }
    return end;
}

void ProcedureRun::act(const Act& act, const Facts& f) {
    if (!std::isfinite(act.amount)) return;
    switch (act.kind) {
        case ActKind::inject: return inject(std::min(act.amount, 100.0), f);
        case ActKind::aspirate: return aspirate(std::min(act.amount, 100.0), f);
        case ActKind::core_throw: return core_throw(act.amount, f);
        case ActKind::wire:
            if (!state_.wire_in) {
                if (!(act.amount > 0) || f.depth_mm <= 0) return;
                state_.wire_label = f.label;
                wire_ = {true, f.skin, f.tip_rest, f.tip_rest};
                if (anatomy_) wire_.from = anatomy_->at_rest(f.skin, f.time_s);
            }
            state_.wire_mm = std::clamp(state_.wire_mm + act.amount, 0.0, kWireMm);
            state_.wire_in = state_.wire_mm > 0;
            state_.wire_was_in = state_.wire_was_in || state_.wire_in;
            if (state_.wire_mm > kWireMm - kWireHeldMm)
                happened(ComplicationKind::wire_lost, f.time_s);
            wire_.in = state_.wire_in;
            if (f.depth_mm > 0 && act.amount > 0) {
                wire_.turn = f.tip_rest;
                wire_.to = wire_end(f, std::min(state_.wire_mm, kShownWireMm));
            }
            return;
        case ActKind::dilate:
            if (act.amount > 0 && state_.wire_in &&
                kind_[static_cast<std::size_t>(state_.wire_label)] == kArtery) {
                happened(ComplicationKind::artery_dilated, f.time_s);
                bleed(wire_.turn, f.time_s);
            }
            return;
        case ActKind::catheter: {
            state_.catheter_in = act.amount > 0 && (state_.wire_in || f.depth_mm > 0);
            catheter_region_ = -1;
            catheter_.in = state_.catheter_in;
            if (!catheter_.in) return;
            if (state_.wire_in) {
                catheter_ = wire_;
            } else {
                catheter_ = {true, anatomy_ ? anatomy_->at_rest(f.skin, f.time_s) : f.skin,
                             f.tip_rest, f.tip_rest};
                if (f.region >= 0 && full_ml_[static_cast<std::size_t>(f.region)] > 0)
                    catheter_region_ = f.region;
            }
            if (catheter_region_ < 0)
                for (std::size_t r = 0; r < regions_.size(); ++r)
                    if (full_ml_[r] > 0 &&
                        contains(r, catheter_.to, anatomy_ ? anatomy_->label(catheter_.to) : 0))
                        catheter_region_ = static_cast<int>(r);
            return;
        }
        case ActKind::drain:
            if (const int from = collection(f); from >= 0 && act.amount > 0) {
                double& left = left_ml_[static_cast<std::size_t>(from)];
                const double out = std::min(act.amount, left);
                left -= out;
                state_.drained_ml += out;
            }
            return;
        case ActKind::compress: state_.compressing = act.amount > 0; return;
        case ActKind::rescan: return;
        case ActKind::tilt: state_.head_down_deg = std::clamp(act.amount, -45.0, 45.0); return;
        case ActKind::valsalva: state_.strains = act.amount > 0; return;
        case ActKind::turn: state_.turned_deg = std::clamp(act.amount, -90.0, 90.0); return;
        case ActKind::answer: {
            const auto& items = exercise_->procedure.items;
            if (act.index < 0 || act.index >= static_cast<int>(items.size())) return;
            const ProcedureItem& item = items[static_cast<std::size_t>(act.index)];
            ProcedureState::Item& state = state_.items[static_cast<std::size_t>(act.index)];
            if (item.rule != ItemRule::asked || state.held) return;
            if (item.from_step >= 0 &&
                !state_.steps[static_cast<std::size_t>(item.from_step)].performed)
                return;  // not asked yet
            state.held = true;
            state.at_s = f.time_s;
            state.answer = static_cast<int>(std::lround(std::clamp(act.amount, -1.0, 1e3)));
            return;
        }
    }
}

void ProcedureRun::count_stray_acts(const Facts& f) {
    constexpr ActKind kInvasive[] = {ActKind::inject, ActKind::core_throw, ActKind::wire,
                                     ActKind::dilate, ActKind::catheter};
    for (const ActKind kind : kInvasive) {
        if (!f.act_any[static_cast<std::size_t>(kind)]) continue;
        const bool asked_for = std::any_of(done_.begin(), done_.end(), [&](const Watch& w) {
            return w.condition.act == static_cast<int>(kind) && holds(w, f);
        });
        if (!asked_for) ++state_.stray_acts;
    }
}

// What the tip goes through.
void ProcedureRun::watch_needle(const Facts& f) {
    if (f.depth_mm <= 0) {
        last_region_ = -1;
        last_vein_ = 0;
        last_depth_mm_ = 0;
        return;
    }
    const Kind kind = kind_[static_cast<std::size_t>(f.label)];
    // A tip in a collection touches nothing of what the collection was put into.
    const bool in_fluid = f.region >= 0 && full_ml_[static_cast<std::size_t>(f.region)] > 0;
    if (!in_fluid) {
        if (kind == kLung) hit_lung(f.tip_rest, f.time_s);
        if (kind == kArtery) happened(ComplicationKind::artery_punctured, f.time_s);
        if (kind == kBowel) happened(ComplicationKind::bowel_punctured, f.time_s);
        if (kind == kBile) happened(ComplicationKind::gallbladder_punctured, f.time_s);
    }
    // Free fluid has no far wall.
    const int region = in_fluid && fluid_of(static_cast<std::size_t>(f.region)) < 0 ? f.region : -1;
    // Elsewhere small veins of an organ lie in the way and do no harm.
    const bool vascular = exercise_->kind == "vascular";
    const int vein = vascular && !in_fluid && kind == kVein ? f.label : 0;
    const bool deeper = f.depth_mm > last_depth_mm_ + kBeyondMm;
    if (deeper &&
        ((last_region_ >= 0 && region != last_region_) || (last_vein_ > 0 && vein != last_vein_)))
        happened(ComplicationKind::through_and_through, f.time_s);
    // The deepest point in the lumen: going back out of it is no harm.
    const bool same = (region >= 0 && region == last_region_) || (vein > 0 && vein == last_vein_);
    if (same) {
        last_depth_mm_ = std::max(last_depth_mm_, f.depth_mm);
    } else if (region >= 0 || vein > 0) {
        last_region_ = region;
        last_vein_ = vein;
        last_depth_mm_ = f.depth_mm;
    } else if (deeper || f.depth_mm < last_depth_mm_ - 3 * kBeyondMm) {
        last_region_ = -1;
        last_vein_ = 0;
    }
}

// The longest chain of performed steps in the order of the file; of equal ones the first.
void ProcedureRun::find_chain() {
    std::array<int, kMaxPerformances> length{}, before{};
    const std::size_t n = performances_.size();
    int best = -1;
    for (std::size_t i = 0; i < n; ++i) {
        length[i] = 1;
        before[i] = -1;
        const int step = performances_[i].step;
        for (std::size_t j = 0; j < i; ++j) {
            const int earlier = performances_[j].step;
            const bool ordered =
                rank(earlier) < rank(step) || (rank(earlier) == rank(step) && earlier != step);
            if (ordered && length[j] + 1 > length[i]) {
                length[i] = length[j] + 1;
                before[i] = static_cast<int>(j);
            }
        }
        if (best < 0 || length[i] > length[static_cast<std::size_t>(best)])
            best = static_cast<int>(i);
    }
    for (std::size_t s = 0; s < exercise_->procedure.steps.size(); ++s)
        state_.steps[s].counts = false;
    for (const Performance& p : performances_)
        state_.steps[static_cast<std::size_t>(p.step)].done_s = p.time_s;
    for (int i = best; i >= 0; i = before[static_cast<std::size_t>(i)]) {
        const Performance& p = performances_[static_cast<std::size_t>(i)];
        state_.steps[static_cast<std::size_t>(p.step)].counts = true;
        state_.steps[static_cast<std::size_t>(p.step)].done_s = p.time_s;
    }
}

void ProcedureRun::perform(int step, double time_s) {
    if (performances_.size() == kMaxPerformances) {
        // What does not count makes room, oldest first; the chain has at most kMaxSteps.
        const auto idle = [&](const Performance& p) {
            const auto& s = state_.steps[static_cast<std::size_t>(p.step)];
            return !s.counts || s.done_s != p.time_s;
        };
        performances_.erase(std::find_if(performances_.begin(), performances_.end(), idle));
    }
    state_.steps[static_cast<std::size_t>(step)].performed = true;
    performances_.push_back({step, time_s});
    new_steps_ |= 1u << step;
    find_chain();
}

void ProcedureRun::update(const SessionSample& sample) {
    update(sample.time_s, sample.probe_ok, sample.mannequin_from_probe, sample.needle_ok,
           sample.mannequin_from_drawn, sample.has_press, sample.press, sample.acts, sample.unseen);
}

void ProcedureRun::update(double time_s,
                          bool probe_ok,
                          const Rigid& mannequin_from_probe,
                          bool needle_ok,
                          const Rigid& mannequin_from_drawn,
                          bool has_press,
                          const PressSample& press,
                          const ActList& acts,
                          bool unseen) {
    new_steps_ = new_complications_ = 0;
    if (!given() || !std::isfinite(time_s)) return;
    Facts f;
    f.time_s = time_s;
    f.dt_s = started_ ? std::clamp(time_s - last_s_, 0.0, kLongestStepS) : 0;
    started_ = true;
    last_s_ = time_s;
    f.probe_ok = probe_ok && is_finite(mannequin_from_probe);
    f.needle_ok = needle_ok && is_finite(mannequin_from_drawn);
    f.probe = mannequin_from_probe;
    f.needle = mannequin_from_drawn;
    f.has_press = has_press;
    f.force_n = as_recorded(press.force_n);
    f.vein_open = as_recorded(press.vein_open);
    f.acts = &acts;
    f.unseen = unseen;
    looked_now_ = false;
    show_pools(pushed_);
    if (f.needle_ok) {
        f.tip = Point3{} + f.needle.translation;
        f.direction = f.needle.rotation.column(2);
        f.tip_rest = f.tip;
        if (anatomy_) {
            f.depth_mm = std::max(insertion_depth_mm(*anatomy_, f.tip, f.direction,
                                                     exercise_->needle.length_mm, &f.skin),
                                  0.0);
            f.tip_rest = tissue_at(f.tip, time_s);
            f.label = f.depth_mm > 0 ? anatomy_->label(f.tip_rest) : 0;
        }
        double nearest = INFINITY;
        for (std::size_t r = 0; r < regions_.size(); ++r) {
            if (f.depth_mm <= 0 || !contains(r, f.tip_rest, f.label)) continue;
            // What lies in the free fluid comes before it.
            const double d = fluid_of(r) >= 0 ? 1e6 : distance(regions_[r].centre, f.tip_rest);
            if (d < nearest) {
                nearest = d;
                f.region = static_cast<int>(r);
            }
        }
        if (f.probe_ok && f.depth_mm > 0 && !unseen) {
            const Rigid probe_from = inverse(f.probe);
            f.tip_in_view =
                sight_.tip_visible(f.probe, probe_from * f.tip, probe_from.rotation * f.direction,
                                   probe_from.rotation * f.needle.rotation.column(0), time_s);
        }
    }
    if (f.probe_ok && anatomy_) f.on_skin = probe_on_skin(*anatomy_, probe_, f.probe);
    state_.needle_was_in = state_.needle_was_in || f.depth_mm > 0;
    state_.probe_was_on_skin = state_.probe_was_on_skin || f.on_skin;
    watch_needle(f);
    for (int i = 0; i < std::clamp(acts.count, 0, ActList::kMaxActs); ++i) {
        const Act& one = acts.acts[static_cast<std::size_t>(i)];
        const auto kind = static_cast<std::size_t>(one.kind);
        if (kind >= static_cast<std::size_t>(kActKinds)) continue;
        act(one, f);
        if (one.amount > 0) f.act_any[kind] = true;
        if (one.amount > 0) f.act_sum[kind] += one.amount;
    }
    count_stray_acts(f);
    settle_fluids();
    if (state_.compressing) {
        state_.compressed_s += f.dt_s;
        state_.bleeding_compressed_s += f.dt_s;
    }
    if (state_.bleeding_pool >= 0) {
        ProcedureState::Pool& pool = state_.pools[static_cast<std::size_t>(state_.bleeding_pool)];
        if (state_.bleeding_compressed_s < kStopBleedingS) {
            const double ml = std::min(kBleedMlS * f.dt_s, kMaxBledMl - pool.ml);
            pool.ml += ml;
            state_.bled_ml += ml;
        }
    }

    if (state_.complication_s[static_cast<std::size_t>(ComplicationKind::pneumothorax)] >= 0)
        state_.air.radius_mm = std::min(state_.air.radius_mm + kAirMmS * f.dt_s, kMaxAirMm);

    const Procedure& p = exercise_->procedure;
    for (std::size_t s = 0; s < p.steps.size(); ++s) {
        ProcedureState::Step& step = state_.steps[s];
        const bool acted = p.steps[s].done.act >= 0;
        if (acted && step.performed) continue;
        const bool grouped = s > 0 ? rank_[s] == rank_[s - 1] : false;
        const bool in_group = grouped || (s + 1 < rank_.size() && rank_[s + 1] == rank_[s]);
        if (in_group && step.performed) continue;
        bool enters_now = false;
        if (!step.entered) {
            step.entered = !p.steps[s].entry.given;
            double none = 0, since = -1;
            if (!step.entered) {
                step.entered = fulfilled(entry_[s], f, none, since);
                enters_now = step.entered;
            }
        }
        if (!step.entered || (enters_now && !acted)) continue;
        const bool done = fulfilled(done_[s], f, step.amount, step.held_since_s);
        const bool now = done && !step.held;
        step.held = done;
        if (!now) continue;
        perform(static_cast<int>(s), time_s);
        if (p.steps[s].entry.given) step.entered = false;  // and once more for another time
    }
    for (std::size_t i = 0; i < p.items.size(); ++i) {
        const ItemRule rule = p.items[i].rule;
        ProcedureState::Item& item = state_.items[i];
        if ((rule != ItemRule::when && rule != ItemRule::never) || item.held) continue;
        if (!fulfilled(item_[i], f, item.amount, item.held_since_s)) continue;
        item.held = true;
        item.at_s = time_s;
    }
}

StepState ProcedureRun::step_state(int step) const {
    const auto& steps = exercise_->procedure.steps;
    const ProcedureState::Step& s = state_.steps[static_cast<std::size_t>(step)];
    if (s.counts) return StepState::done;
    // Whether an earlier step of the chain was performed after it, or a later one before it.
    bool earlier_follows = false, later_before = false, later = false;
    for (int other = 0; other < static_cast<int>(steps.size()); ++other) {
        const ProcedureState::Step& o = state_.steps[static_cast<std::size_t>(other)];
        if (!o.counts) continue;
        if (rank(other) > rank(step)) {
            later = true;
            later_before = later_before || o.done_s <= s.done_s;
        }
        earlier_follows = earlier_follows || (rank(other) < rank(step) && o.done_s > s.done_s);
    }
    if (s.performed)
        return earlier_follows && !later_before ? StepState::too_early : StepState::too_late;
    return later ? StepState::missed : StepState::waiting;
}

int ProcedureRun::present_step() const {
    for (int s = 0; s < static_cast<int>(exercise_->procedure.steps.size()); ++s)
        if (step_state(s) == StepState::waiting) return s;
    return -1;
}

// Whether what the condition asks for could have come about in this session.
bool ProcedureRun::tried(const Watch& w) const {
    const Condition& c = w.condition;
    if (w.step >= 0) return state_.steps[static_cast<std::size_t>(w.step)].performed;
    if (c.act >= 0) return state_.needle_was_in || state_.probe_was_on_skin;
    if (w.complication == static_cast<int>(ComplicationKind::wire_lost) || c.wire_in == 1)
        return state_.wire_was_in;
    if (!w.taken.empty) return state_.throws > 0;
    const bool of_needle = w.complication >= 0 || w.aspirated >= 0 || !w.tip_in.empty ||
                           c.needle_in == 1 || c.tip_in_view == 1 || c.depth_at_least_mm >= 0 ||
                           c.drained_at_least >= 0;
    return of_needle ? state_.needle_was_in : state_.probe_was_on_skin;
}

bool ProcedureRun::item_ticked(int index) const {
    const ProcedureItem& item = exercise_->procedure.items[static_cast<std::size_t>(index)];
    const ProcedureState::Item& state = state_.items[static_cast<std::size_t>(index)];
    switch (item.rule) {
        case ItemRule::step: return state_.steps[static_cast<std::size_t>(item.step)].counts;
        case ItemRule::when: return state.held;
        case ItemRule::never: return !state.held && tried(item_[static_cast<std::size_t>(index)]);
        case ItemRule::asked: {
            int right = item.answer;
            if (!item.finding.empty() &&
                std::none_of(regions_.begin(), regions_.end(),
                             [&](const Target& r) { return r.name == item.finding; }))
                right = item.answer_without;
            return state.held && state.answer == right;
        }
    }
    return false;
}

ProcedureView ProcedureRun::view() const {
    ProcedureView view;
    const Procedure& p = exercise_->procedure;
    view.state = state_;
    view.present_step = present_step();
    for (std::size_t s = 0; s < p.steps.size(); ++s)
        view.steps[s] = static_cast<int>(s) == view.present_step ? StepState::present
                                                                 : step_state(static_cast<int>(s));
    view.question = next_question(p, state_);
    return view;
}

int next_question(const Procedure& procedure, const ProcedureState& state, int after) {
    const int count = static_cast<int>(procedure.items.size());
    for (int i = after + 1; i < count; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const ProcedureItem& item = procedure.items[at];
        const bool asked =
            item.from_step < 0 || state.steps[static_cast<std::size_t>(item.from_step)].performed;
        if (item.rule == ItemRule::asked && asked && !state.items[at].held) return i;
    }
    return -1;
}

double ProcedureRun::free_fluid_ml() const {
    double ml = 0;
    for (std::size_t i = 0; i < fluids_.size(); ++i) ml += left_ml_[first_fluid_ + i];
    return ml;
}

double ProcedureRun::volume_ml(int target) const {
    return target >= 0 && target < static_cast<int>(left_ml_.size())
               ? left_ml_[static_cast<std::size_t>(target)]
               : 0;
}

SceneChange ProcedureRun::scene() const {
    SceneChange out;
    if (!given()) return out;
    show_pools(out);
    const std::size_t shown = exercise_->targets.size();
    for (std::size_t t = 0; t < out.target_scale.size() && t < shown; ++t)
        if (full_ml_[t] > 0 && left_ml_[t] != full_ml_[t])
            out.target_scale[t] = std::cbrt(left_ml_[t] / full_ml_[t]);
    out.wire = wire_;
    out.catheter = catheter_;
    out.air = state_.air;
    for (const Fluid& fluid : fluids_)
        out.levels[static_cast<std::size_t>(out.level_count++)] = fluid.level;
    const VeinState veins =
        vein_state(exercise_->deformation, state_.head_down_deg, state_.strains);
    out.vein_wall_mm = veins.wall_mm;
    out.venous_pressure_mmhg = veins.pressure_mmhg;
    return out;
}

ProcedureResult ProcedureRun::result() const {
    ProcedureResult out;
    if (!given()) return out;
    const Procedure& p = exercise_->procedure;
    for (int s = 0; s < static_cast<int>(p.steps.size()); ++s) {
        const ProcedureState::Step& state = state_.steps[static_cast<std::size_t>(s)];
        StepState now = step_state(s);
        if (now == StepState::waiting) now = StepState::missed;
        const ProcedureStep& step = p.steps[static_cast<std::size_t>(s)];
        out.steps.push_back({step.name, step.title, now, state.done_s});
    }
    out.cut = p.cut;
    out.max_points = p.points();
    for (int i = 0; i < static_cast<int>(p.items.size()); ++i) {
        const ProcedureItem& item = p.items[static_cast<std::size_t>(i)];
        const ProcedureState::Item& state = state_.items[static_cast<std::size_t>(i)];
        ProcedureResult::Item row{.name = item.name,
                                  .title = item.title,
                                  .source = item.source,
                                  .critical = item.critical,
                                  .ticked = item_ticked(i),
                                  .weight = item.weight,
                                  .time_s = state.at_s,
                                  .why = ""};
        if (item.rule == ItemRule::step) {
            const ProcedureResult::Step& step = out.steps[static_cast<std::size_t>(item.step)];
            row.time_s = step.time_s;
            if (!row.ticked)
                row.why =
                    step.state == StepState::missed ? "not_done" : step_state_name(step.state);
        } else if (!row.ticked) {
            const bool never = item.rule == ItemRule::never;
            row.why = never && state.held           ? "happened"
                      : never                       ? "not_tried"
                      : item.rule == ItemRule::when ? "not_done"
                      : state.held                  ? "wrong_answer"
                                                    : "not_answered";
        }
        if (row.ticked) out.points += item.weight;
        if (item.critical && !row.ticked) out.passed = false;
        out.items.push_back(std::move(row));
    }
    out.stray_acts = state_.stray_acts;
    out.stray_acts_at_most = p.stray_acts_at_most;
    out.passed = out.passed && out.points >= p.cut && out.stray_acts <= out.stray_acts_at_most;
    for (std::size_t k = 0; k < state_.complication_s.size(); ++k)
        if (state_.complication_s[k] >= 0)
            out.complications.push_back({complication_names()[k], state_.complication_s[k]});
    std::stable_sort(out.complications.begin(), out.complications.end(),
                     [](const auto& a, const auto& b) { return a.time_s < b.time_s; });
    out.taken = taken();
    out.injected_ml = state_.injected_ml;
    out.aspirated_ml = state_.aspirated_ml;
    out.drained_ml = state_.drained_ml;
    out.bled_ml = state_.bled_ml;
    return out;
}

std::vector<ProcedureResult::Taken> ProcedureRun::taken() const {
    std::vector<ProcedureResult::Taken> out;
    for (int i = 0; i < state_.taken_count; ++i) {
        const ProcedureState::Taken& taken = state_.taken[static_cast<std::size_t>(i)];
        const std::string name = taken.label < 0
                                     ? regions_[static_cast<std::size_t>(-1 - taken.label)].name
                                 : taken.label < static_cast<int>(names_.size())
                                     ? names_[static_cast<std::size_t>(taken.label)]
                                     : std::string();
        out.push_back({name, taken.mm});
    }
    return out;
}

std::vector<TrayAct> tray_now(const Procedure& procedure, const ProcedureState& state) {
    std::vector<TrayAct> tray = procedure_tray(procedure);
    std::erase_if(tray, [&](const TrayAct& one) {
        const bool on = one.act.amount > 0;
        if (one.act.kind == ActKind::compress) return on == state.compressing;
        if (one.act.kind == ActKind::tilt) return on == (state.head_down_deg > 0);
        if (one.act.kind == ActKind::valsalva) return on == state.strains;
        if (one.act.kind == ActKind::turn) return on == (state.turned_deg != 0);
        return one.act.kind == ActKind::catheter && on == state.catheter_in;
    });
    return tray;
}

std::optional<ProcedureResult> procedure_result(const Session& session,
                                                const Exercise& exercise,
                                                const Anatomy* anatomy,
                                                const std::vector<Label>& labels) {
    if (!exercise.procedure.given()) return {};
    ProcedureRun run(exercise, std::shared_ptr<const Anatomy>(std::shared_ptr<void>(), anatomy),
                     labels);
    for (const SessionSample& sample : session.samples) run.update(sample);
    return run.result();
}

const char* step_state_name(StepState state) {
    constexpr const char* kNames[] = {"waiting",   "present",  "done",
                                      "too_early", "too_late", "missed"};
    return kNames[static_cast<std::size_t>(state)];
}

const char* missed_words(std::string_view why) {
    return why == "too_early"      ? "Too early"
           : why == "too_late"     ? "Too late"
           : why == "happened"     ? "It happened"
           : why == "not_tried"    ? "Not tried"
           : why == "wrong_answer" ? "Answered wrongly"
           : why == "not_answered" ? "Not answered"
                                   : "Not done";
}

}  // namespace sonocase
