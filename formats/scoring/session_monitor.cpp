// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/session_monitor.h"

#include <cmath>
#include <limits>

#include "formats/base/portable_math.h"
#include "formats/scoring/sight.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

constexpr const char* kNames[] = {
    "needle_entry",    "needle_exit",    "target_hit",     "target_scanned", "no_go_contact",
    "no_go_left",      "probe_contact",  "probe_lifted",   "needle_lost",    "needle_found",
    "probe_lost",      "probe_found",    "deepest",        "key_frame",      "session_end",
    "tissue_puncture", "posterior_wall", "needle_stopped", "step_performed", "complication"};

// Words are separated by blanks, so names must not contain any.
std::string word(std::string text) {
    for (char& c : text) {
        if (c == ' ' || c == '=') c = '_';
    }
    return text;
}

}  // namespace

SessionEvent session_event(const LiveEvent& event,
                           const Exercise& exercise,
                           const std::vector<Label>& labels) {
    SessionEvent out{event.time_s, event.frame, kNames[static_cast<std::size_t>(event.kind)], ""};
    const auto index = static_cast<std::size_t>(std::max(event.index, 0));
    switch (event.kind) {
        case LiveEventKind::needle_entry:
        case LiveEventKind::needle_exit:
        case LiveEventKind::deepest:
            out.detail = "insertion=" + std::to_string(event.index) +
                         " depth_mm=" + number_text(event.value, 5);
            break;
        case LiveEventKind::target_hit:
        case LiveEventKind::target_scanned:
            out.detail = "target=" + std::to_string(event.index);
            if (index < exercise.targets.size())
                out.detail += " name=" + word(exercise.targets[index].name);
            if (event.kind == LiveEventKind::target_hit) {
                out.detail += " distance_mm=" + number_text(event.value, 5);
            }
            break;
        case LiveEventKind::no_go_contact:
        case LiveEventKind::no_go_left:
            if (index < labels.size()) out.detail = "label=" + word(labels[index].name);
            break;
        case LiveEventKind::tissue_puncture:
        case LiveEventKind::posterior_wall:
        case LiveEventKind::needle_stopped:
            if (index < labels.size()) out.detail = "label=" + word(labels[index].name) + " ";
            out.detail += "force_n=" + number_text(event.value, 5);
            break;
        case LiveEventKind::step_performed:
            if (index < exercise.procedure.steps.size())
                out.detail = "step=" + word(exercise.procedure.steps[index].name);
            break;
        case LiveEventKind::complication:
            if (index < complication_names().size())
                out.detail = "name=" + complication_names()[index];
            break;
        default: break;
    }
    return out;
}

bool probe_on_skin(const Anatomy& anatomy, const Probe& probe, const Rigid& mannequin_from_probe) {
    constexpr double kPressMm = 2;
    for (const double part : {0.0, -0.5, 0.5, -1.0, 1.0}) {
        Point3 face{0, 0, kPressMm};
        if (probe.shape == ProbeShape::curvilinear) {
            const double angle = 0.5 * part * probe.field_of_view_rad;
            face = {probe.radius_mm * sine(angle), 0,
                    probe.radius_mm * (cosine(angle) - 1) + kPressMm};
        } else {
            face.x = 0.5 * part * probe.width_mm;
        }
        if (anatomy.inside(mannequin_from_probe * face)) return true;
    }
    return false;
}

SessionMonitor::SessionMonitor(const Exercise& exercise,
                               const Anatomy* anatomy,
                               const std::vector<Label>& labels,
                               const ScoreOptions& options)
    : exercise_(&exercise),
      anatomy_(anatomy),
      sight_(anatomy, exercise),
      options_(options),
      detector_(options.insertion),
      is_no_go_(256, false),
      hit_(exercise.targets.size(), false),
      scanned_(exercise.targets.size(), false) {
    for (std::size_t i = 0; i < labels.size() && i < is_no_go_.size(); ++i) {
        for (const std::string& name : exercise.no_go) {
            if (labels[i].name == name) is_no_go_[i] = true;
        }
    }
    events_.reserve(2 * exercise.targets.size() + exercise.procedure.steps.size() + 24);
}

void SessionMonitor::add(LiveEventKind kind, double time_s, int index, double value) {
    if (events_.size() < events_.capacity())
        events_.push_back({kind, index, value, time_s, frame_});
}

void SessionMonitor::report_procedure(std::uint32_t new_steps, std::uint32_t new_complications) {
    for (int bit = 0; bit < 32; ++bit) {
        if ((new_steps >> bit & 1) != 0) add(LiveEventKind::step_performed, last_time_s_, bit);
        if ((new_complications >> bit & 1) != 0)
            add(LiveEventKind::complication, last_time_s_, bit);
    }
}

void SessionMonitor::watch_state(
    bool now, bool& state, double time_s, LiveEventKind on, LiveEventKind off) {
    if (now == state) return;
    state = now;
    add(now ? on : off, time_s);
}

void SessionMonitor::watch_needle(double time_s, const Rigid& needle) {
    const Point3 tip{needle.translation.x, needle.translation.y, needle.translation.z};
    const Vector3 direction = needle.rotation.column(2);
    Point3 skin;
    const double depth =
        insertion_depth_mm(*anatomy_, tip, direction, exercise_->needle.length_mm, &skin);
    depth_mm_ = std::max(depth, 0.0);
    if (depth > 0 && time_s > last_time_s_) time_in_tissue_s_ += time_s - last_time_s_;
    const InsertionChange change = detector_.update(time_s, depth, direction, skin);
    if (change == InsertionChange::entered) {
        add(LiveEventKind::needle_entry, detector_.entry_time_s(), detector_.insertions(), depth);
        deepest_mm_ = 0;
    }
    if (detector_.inserted() && depth > deepest_mm_) {
        deepest_mm_ = depth;
        deepest_s_ = time_s;
    }
    if (change == InsertionChange::left) {
        add(LiveEventKind::deepest, deepest_s_, detector_.insertions(), deepest_mm_);
        add(LiveEventKind::needle_exit, detector_.exit_time_s(), detector_.insertions(),
            deepest_mm_);
    }
    int touched = -1;
    for (double s = 0; s <= depth && touched < 0; s += options_.shaft_step_mm) {
        const int label = anatomy_->label(anatomy_->at_rest(tip - s * direction, time_s));
        if (is_no_go_[label]) touched = label;
    }
    if (touched >= 0) {
        if (no_go_now_ < 0) add(LiveEventKind::no_go_contact, time_s, touched);
        no_go_now_ = touched;
        no_go_last_s_ = time_s;
    } else if (no_go_now_ >= 0 && time_s - no_go_last_s_ > options_.contact_pause_s) {
        add(LiveEventKind::no_go_left, no_go_last_s_, no_go_now_);
        no_go_now_ = -1;
    }
}

void SessionMonitor::watch_targets(
    double time_s, bool probe_ok, const Rigid& probe, bool needle_ok, Point3 tip) {
    to_target_mm_ = std::numeric_limits<double>::quiet_NaN();
    nearest_ = -1;
    const Rigid probe_from = inverse(probe);
    for (std::size_t t = 0; t < exercise_->targets.size(); ++t) {
        const Target& target = exercise_->targets[t];
        const Point3 centre = anatomy_ ? anatomy_->moved(target.centre, time_s) : target.centre;
        if (needle_ok) {
            const double d = distance(centre, tip);
            if (!(d >= to_target_mm_)) {
                to_target_mm_ = d;
                nearest_ = static_cast<int>(t);
            }
            if (!hit_[t] && d <= target.hit_radius_mm) {
                hit_[t] = true;
                ++hits_;
                add(LiveEventKind::target_hit, time_s, static_cast<int>(t), d);
            }
        }
        if (!probe_ok || scanned_[t]) continue;
        const Point3 p = probe_from * centre;
        if (std::abs(p.y) < options_.target_slab_mm && in_image(exercise_->probe, p.x, p.z)) {
            scanned_[t] = true;
            add(LiveEventKind::target_scanned, time_s, static_cast<int>(t));
        }
    }
}

std::span<const LiveEvent> SessionMonitor::update(double time_s,
                                                  std::int64_t frame,
                                                  bool probe_ok,
                                                  const Rigid& mannequin_from_probe,
                                                  bool needle_ok,
                                                  const Rigid& mannequin_from_drawn,
                                                  bool unseen) {
    events_.clear();
    frame_ = frame;
    if (!started_) {
        started_ = true;
        last_time_s_ = time_s;
        needle_tracked_ = needle_ok;
        probe_tracked_ = probe_ok;
    }
    watch_state(probe_ok, probe_tracked_, time_s, LiveEventKind::probe_found,
                LiveEventKind::probe_lost);
    watch_state(needle_ok, needle_tracked_, time_s, LiveEventKind::needle_found,
                LiveEventKind::needle_lost);
    const Vector3 at = mannequin_from_drawn.translation;
    const Point3 tip{at.x, at.y, at.z};
    if (anatomy_ && probe_ok) {
        const bool now = probe_on_skin(*anatomy_, exercise_->probe, mannequin_from_probe);
        if (now) probe_off_s_ = time_s;
        // A probe that bounces on the skin must not give two events per frame.
        if (now || time_s - probe_off_s_ > options_.contact_pause_s) {
            watch_state(now, probe_on_skin_, time_s, LiveEventKind::probe_contact,
                        LiveEventKind::probe_lifted);
        }
    }
    tip_in_view_ = false;
    if (probe_ok && needle_ok && !unseen) {
        const Rigid probe_from = inverse(mannequin_from_probe);
        tip_in_view_ =
            sight_.tip_visible(mannequin_from_probe, probe_from * tip,
                               probe_from * mannequin_from_drawn.rotation.column(2),
                               probe_from * mannequin_from_drawn.rotation.column(0), time_s);
    }
    if (anatomy_ && needle_ok) watch_needle(time_s, mannequin_from_drawn);
    watch_targets(time_s, probe_ok && !unseen, mannequin_from_probe, needle_ok, tip);
    last_time_s_ = std::max(last_time_s_, time_s);
    return events_;
}

}  // namespace sonocase
