// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/session_score.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "formats/exercise/metric_table.h"
#include "formats/scoring/image_region.h"
#include "formats/scoring/needle_readings.h"
#include "formats/scoring/session_monitor.h"
#include "formats/scoring/target_tree.h"

namespace sonocase {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegrees = 180 / 3.14159265358979323846;

Point3 origin_of(const Rigid& t) {
    return {t.translation.x, t.translation.y, t.translation.z};
}

class Scorer {
  public:
    Scorer(const Session& session,
           const Exercise& exercise,
           const Anatomy* anatomy,
           const std::vector<Label>& labels,
           const ScoreOptions& options)
        : session_(session),
          exercise_(exercise),
          anatomy_(anatomy),
          labels_(labels),
          options_(options) {
        for (const Label& label : labels) {
            has_no_go_ = has_no_go_ ||
                         std::count(exercise.no_go.begin(), exercise.no_go.end(), label.name) > 0;
        }
    }

    SessionScore score() {
        probe_ = track_of(session_, Tool::probe);
        needle_ = track_of(session_, Tool::drawn_needle);
        readings_ = look_up_readings(session_, needle_, exercise_, anatomy_, labels_, options_);
        session_metrics();
        motion("needle_", motion_metrics(needle_.points, options_.motion), !needle_.points.empty());
        motion("probe_", motion_metrics(probe_.points, options_.motion), !probe_.points.empty());
        if (!needle_.points.empty()) {
            needle_metrics();
            find_insertions();
            target_metrics();
            guidance_metrics();
        }
        probe_metrics();
        curves();
        finish();
        return std::move(out_);
    }

  private:
    double time(std::size_t i) const { return needle_.points[i].time_s; }
    double step_s(std::size_t i) const { return i == 0 ? 0 : time(i) - time(i - 1); }
    Point3 tip(std::size_t i) const { return origin_of(needle_.points[i].pose); }
    Vector3 direction(std::size_t i) const { return needle_.points[i].pose.rotation.column(2); }
    void set(const std::string& name, double value) { values_[name] = value; }
    // Where target t is at a time.
    Point3 target_at(std::size_t t, double time_s) const {
        const Point3 centre = exercise_.targets[t].centre;
        return anatomy_ ? anatomy_->moved(centre, time_s) : centre;
    }
    double target_shift_mm() const { return anatomy_ ? anatomy_->greatest_shift_mm() : 0; }

    void session_metrics() {
        double first = INFINITY, last = -INFINITY;
        for (const ToolTrack* track : {&probe_, &needle_}) {
            if (track->points.empty()) continue;
            first = std::min(first, track->points.front().time_s);
            last = std::max(last, track->points.back().time_s);
        }
        if (first <= last) set("elapsed_time_s", last - first);
        if (!needle_.points.empty()) set("tracking_gap_s", needle_.longest_gap_s);
        const std::size_t back = probe_.run_back + needle_.run_back;
        if (back > 0) {
            out_.warnings.push_back(
                std::to_string(back) +
                " readings whose time ran back or whose pose was not finite were left out.");
        }
        if (!anatomy_)
            out_.warnings.push_back("No body was given: what needs one was not measured.");
    }

    void motion(const std::string& tool, const MotionMetrics& m, bool there) {
        if (!there) return;
        set(tool + "elapsed_time_s", m.elapsed_time_s);
        set(tool + "path_length_mm", m.path_length_mm);
        set(tool + "filtered_path_length_mm", m.filtered_path_length_mm);
        set(tool + "average_velocity_mm_s", m.average_velocity_mm_s);
        set(tool + "motion_smoothness_mm_s3", m.motion_smoothness_mm_s3);
        set(tool + "path_inefficiency_percent", m.path_inefficiency_percent);
        set(tool + "translational_actions", m.translational_actions);
        set(tool + "rotational_actions", m.rotational_actions);
        set(tool + "rotation_total_deg", m.rotation_total_deg);
        set(tool + "bounding_box_mm3", m.bounding_box_mm3);
    }

    void needle_metrics() {
        double axial = 0;
        for (std::size_t i = 1; i < readings_.size(); ++i) {
            axial += std::abs(dot(tip(i) - tip(i - 1), direction(i)));
        }
        set("depth_perception_mm", axial);
        if (!anatomy_) return;
        double path = 0, time_in = 0, damage = 0, no_go_s = 0, deepest = 0;
        int punctures = 0;
        bool punctured = false;
        const double length = exercise_.needle.length_mm;
        for (std::size_t i = 0; i < readings_.size(); ++i) {
            const NeedleReading& r = readings_[i];
            deepest = std::max(deepest, r.depth_mm);
            if (!punctured && r.inside && r.ahead && r.behind) {
                ++punctures;
                punctured = true;
            } else if (punctured && !r.inside && !r.ahead && !r.behind) {
                punctured = false;
            }
            if (i == 0 || !r.inside) continue;
            path += distance(tip(i), tip(i - 1));
            time_in += step_s(i);
            if (r.no_go) no_go_s += step_s(i);
            const NeedleReading& before = readings_[i - 1];
            if (!before.inside) continue;
            // The shaft swept the quadrilateral between its two inserted parts: two triangles.
            const Point3 end = tip(i) - std::min(r.depth_mm, length) * direction(i);
            const Point3 end_before =
                tip(i - 1) - std::min(before.depth_mm, length) * direction(i - 1);
            damage += 0.5 * norm(cross(tip(i) - tip(i - 1), end - tip(i - 1)));
            damage += 0.5 * norm(cross(end - tip(i - 1), end_before - tip(i - 1)));
        }
        set("path_in_tissue_mm", path);
        set("time_in_tissue_s", time_in);
        set("tissue_damage_mm2", damage);
        set("tissue_punctures", punctures);
        set("deepest_mm", deepest);
        set("skin_contacts", contacts([](const NeedleReading& r) { return r.touches; }));
        if (has_no_go_ || exercise_.no_go.empty()) {
            set("no_go_contacts", contacts([](const NeedleReading& r) { return r.no_go; }));
            set("no_go_time_s", no_go_s);
        } else {
            out_.warnings.push_back("The body has none of the structures to be spared.");
        }
    }

    template <class Touches>
    int contacts(Touches touches) const {
        int count = 0;
        double last_s = -INFINITY;
        for (std::size_t i = 0; i < readings_.size(); ++i) {
            if (!touches(readings_[i])) continue;
            const bool keep_session = i > 0 && touches(readings_[i - 1]);
            if (!keep_session && time(i) - last_s > options_.contact_pause_s) ++count;
            last_s = time(i);
        }
        return count;
    }

    void find_insertions() {
        if (!anatomy_) return;
        InsertionDetector detector(options_.insertion);
        for (std::size_t i = 0; i < readings_.size(); ++i) {
            const NeedleReading& r = readings_[i];
            const InsertionChange change =
                detector.update(time(i), r.depth_mm, direction(i), r.skin);
            if (change == InsertionChange::entered) {
                InsertionScore s;
                s.entry_s = detector.entry_time_s();
                s.entry = detector.entry_point();
                s.entry_direction = detector.entry_direction();
                s.still_in = true;
                out_.insertions.push_back(s);
            }
            if (detector.inserted()) {
                InsertionScore& s = out_.insertions.back();
                s.exit_s = time(i);
                const bool deeper = r.depth_mm > s.deepest_mm;
                if (deeper) {
                    s.deepest_mm = r.depth_mm;
                    s.deepest_s = time(i);
                    deepest_.resize(out_.insertions.size());
                    deepest_.back() = i;
                }
            }
            if (change == InsertionChange::left) {
                out_.insertions.back().exit_s = detector.exit_time_s();
                out_.insertions.back().still_in = false;
            }
        }
        for (std::size_t k = 0; k < out_.insertions.size(); ++k) {
            InsertionScore& s = out_.insertions[k];
            const std::size_t i = s.still_in ? readings_.size() - 1 : deepest_[k];
            s.final_tip = tip(i);
            s.final_direction = direction(i);
            s.tip_to_target_mm = kNan;
            double nearest = INFINITY;
            for (std::size_t t = 0; t < exercise_.targets.size(); ++t) {
                const Point3 centre = target_at(t, time(i));
                const double d = distance(s.final_tip, centre);
                if (d < nearest) {
                    nearest = d;
                    s.target = static_cast<int>(t);
                    s.target_centre = centre;
                    s.tip_to_target_mm = d;
                }
            }
        }
        set("insertions", static_cast<double>(out_.insertions.size()));
    }

    void target_metrics() {
        const std::vector<Target>& targets = exercise_.targets;
        if (targets.empty()) return;
        out_.targets.resize(targets.size());
        TargetTree hits(targets);
        const double shift = target_shift_mm();
        int hit = 0;
        for (std::size_t i = 0; i < readings_.size() && !hits.empty(); ++i) {
            const Point3 p = tip(i);
            hits.search([&](Point3 c, double radius) { return distance(c, p) <= radius + shift; },
                        [&](std::uint32_t t) {
                            const double d = distance(target_at(t, time(i)), p);
                            if (!(d <= targets[t].hit_radius_mm)) return false;
                            out_.targets[t].first_hit_s = time(i);
                            ++hit;
                            return true;
                        });
        }
        set("targets_hit", hit);
        set("targets_hit_fraction", hit / static_cast<double>(targets.size()));
        if (out_.insertions.empty()) return;
        double error = 0;
        for (const InsertionScore& s : out_.insertions) error += s.tip_to_target_mm;
        set("targeting_error_mm", error / static_cast<double>(out_.insertions.size()));
        const InsertionScore& last = out_.insertions.back();
        set("final_tip_to_target_mm", last.tip_to_target_mm);
        const Vector3 way = last.target_centre - last.entry;
        if (!(norm(way) > 0)) return;
        const Vector3 u = normalized(way);
        // atan2 keeps its figures at small angles, where acos loses half of them.
        set("final_angle_deg", kDegrees * std::atan2(norm(cross(last.final_direction, u)),
                                                     dot(last.final_direction, u)));
        double greatest = 0, sum = 0, weight = 0;
        for (std::size_t i = 0; i < readings_.size(); ++i) {
            if (!readings_[i].inside || time(i) < last.entry_s || time(i) > last.exit_s) continue;
            const double off = norm(cross(tip(i) - last.entry, u));
            greatest = std::max(greatest, off);
            sum += step_s(i) * off;
            weight += step_s(i);
        }
        set("trajectory_deviation_mm", greatest);
        if (weight > 0) set("trajectory_deviation_mean_mm", sum / weight);
    }

    void guidance_metrics() {
        if (!anatomy_ || probe_.points.empty()) return;
        double in_beam = 0, inserted = 0, seconds = 0, view_s = 0, plane = 0, plane_max = 0,
               angle = 0;
        double advance = 0, advance_in_view = 0;
        for (std::size_t i = 1; i < readings_.size(); ++i) {
            const NeedleReading& r = readings_[i];
            if (!r.inside || !r.seen) continue;
            const double dt = step_s(i);
            in_beam += dt * r.in_beam_mm;
            inserted += dt * r.depth_mm;
            seconds += dt;
            if (r.tip_in_view) view_s += dt;
            plane += dt * std::abs(r.plane_mm);
            plane_max = std::max(plane_max, std::abs(r.plane_mm));
            const Vector3 normal =
                session_.samples[needle_.points[i].sample].mannequin_from_probe.rotation.column(1);
            const double sine = std::min(std::abs(dot(normal, direction(i))), 1.0);
            angle += dt * kDegrees * std::asin(sine);
            const double forward = std::max(dot(tip(i) - tip(i - 1), direction(i)), 0.0);
            advance += forward;
            if (r.tip_in_view) advance_in_view += forward;
        }
        if (!(seconds > 0)) return;
        if (inserted > 0) set("needle_in_beam_fraction", in_beam / inserted);
        set("needle_in_beam_mm", in_beam / seconds);
        set("tip_in_view_fraction", view_s / seconds);
        if (advance > 0) set("tip_in_view_at_advance_fraction", advance_in_view / advance);
        set("needle_plane_distance_mean_mm", plane / seconds);
        set("needle_plane_distance_max_mm", plane_max);
        set("needle_plane_angle_mean_deg", angle / seconds);
    }

    void probe_metrics() {
        if (probe_.points.empty()) return;
        const Probe& probe = exercise_.probe;
        if (anatomy_) {
            double usage = 0;
            for (std::size_t i = 1; i < probe_.points.size(); ++i) {
                if (probe_on_skin(*anatomy_, probe, probe_.points[i].pose))
                    usage += probe_.points[i].time_s - probe_.points[i - 1].time_s;
            }
            set("probe_usage_time_s", usage);
        }
        const std::vector<Target>& targets = exercise_.targets;
        if (targets.empty()) return;
        out_.targets.resize(targets.size());
        TargetTree centres(targets), parts(targets);
        const double reach = probe.depth_mm + std::max(probe.radius_mm, probe.width_mm);
        const double slack = options_.target_slab_mm + target_shift_mm();
        int scanned = 0, seen = 0;
        for (const TrackPoint& point : probe_.points) {
            if (centres.empty() && parts.empty()) break;
            const Rigid probe_from = inverse(point.pose);
            const auto near = [&](Point3 c, double radius) {
                const Point3 p = probe_from * c;
                return std::abs(p.y) <= radius + slack &&
                       std::hypot(p.x, p.z) <= reach + radius + slack;
            };
            centres.search(near, [&](std::uint32_t t) {
                const Point3 p = probe_from * target_at(t, point.time_s);
                if (!(std::abs(p.y) < options_.target_slab_mm) || !in_image(probe, p.x, p.z))
                    return false;
                out_.targets[t].first_scanned_s = point.time_s;
                ++scanned;
                return true;
            });
            parts.search(near, [&](std::uint32_t t) {
                const Point3 p = probe_from * target_at(t, point.time_s);
                const double radius = targets[t].radius_mm;
                if (!(std::abs(p.y) <= radius)) return false;
                const double in_plane = std::sqrt(radius * radius - p.y * p.y);
                if (!(distance_to_image(probe, p.x, p.z) <= in_plane)) return false;
                out_.targets[t].first_seen_s = point.time_s;
                ++seen;
                return true;
            });
        }
        const double count = static_cast<double>(targets.size());
        set("targets_scanned_percent", 100 * scanned / count);
        set("structures_scanned_percent", 100 * seen / count);
    }

    void curves() {
        SessionCurves& c = out_.curves;
        for (std::size_t i = 0; i < readings_.size(); ++i) {
            const NeedleReading& r = readings_[i];
            c.time_s.push_back(time(i));
            c.depth_mm.push_back(anatomy_ ? std::max(r.depth_mm, 0.0) : kNan);
            c.plane_distance_mm.push_back(r.plane_mm);
            c.in_beam_fraction.push_back(r.seen && r.depth_mm > 0 ? r.in_beam_mm / r.depth_mm
                                                                  : kNan);
            double nearest = kNan;
            // Beyond a few targets the curve of the nearest says little and costs much.
            if (exercise_.targets.size() <= 64) {
                for (std::size_t t = 0; t < exercise_.targets.size(); ++t) {
                    const double d = distance(target_at(t, time(i)), tip(i));
                    if (!(d >= nearest)) nearest = d;
                }
            }
            c.tip_to_target_mm.push_back(nearest);
        }
    }

    void finish() {
        for (const MetricInfo& info : metric_table()) {
            const auto found = values_.find(info.name);
            out_.metrics.push_back({info.name, found == values_.end() ? kNan : found->second});
        }
        for (const Exercise::PassMark& mark : exercise_.pass_marks) {
            PassResult result{mark.metric, out_.value(mark.metric), mark.at_most, mark.at_least,
                              false};
            result.passed =
                result.value <= mark.at_most && result.value >= mark.at_least;  // NaN fails
            out_.passed = out_.passed && result.passed;
            out_.pass_marks.push_back(std::move(result));
        }
    }

    const Session& session_;
    const Exercise& exercise_;
    const Anatomy* anatomy_;
    const std::vector<Label>& labels_;
    const ScoreOptions& options_;
    bool has_no_go_ = false;
    ToolTrack probe_, needle_;
    std::vector<NeedleReading> readings_;
    std::vector<std::size_t> deepest_;
    std::map<std::string, double> values_;
    SessionScore out_;
};

}  // namespace

BreathingMotion breathing_shown(const Exercise& exercise,
                                bool physical_model,
                                const std::vector<std::string>& effects) {
    // A list that only takes away starts from everything, any other from nothing.
    bool on = std::all_of(effects.begin(), effects.end(),
                          [](const std::string& e) { return !e.empty() && e[0] == '-'; });
    for (const std::string& e : effects) on = on || e == "auto" || e == "all";
    for (const std::string& e : effects) {
        if (e == "breathing") on = true;
        if (e == "-breathing") on = false;
    }
    return physical_model && on ? exercise.breathing : BreathingMotion{};
}

BreathingMotion breathing_shown(const Exercise& exercise, const SessionHeader& header) {
    std::vector<std::string> effects;
    std::istringstream words(detail_value(header.render, "effects"));
    for (std::string word; std::getline(words, word, ',');) effects.push_back(word);
    return breathing_shown(exercise, detail_value(header.render, "model") == "physical", effects);
}

double SessionScore::value(std::string_view name) const {
    for (const Metric& metric : metrics) {
        if (metric.name == name) return metric.value;
    }
    return kNan;
}

SessionScore score_session(const Session& session,
                           const Exercise& exercise,
                           const Anatomy* anatomy,
                           const std::vector<Label>& labels,
                           const ScoreOptions& options) {
    return Scorer(session, exercise, anatomy, labels, options).score();
}

}  // namespace sonocase
