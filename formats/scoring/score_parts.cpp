// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/score_parts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "formats/base/constants.h"
#include "formats/base/portable_math.h"
#include "formats/scoring/session_monitor.h"
#include "formats/scoring/sight.h"
#include "formats/scoring/target_tree.h"
#include "formats/volume/tissue.h"

namespace sonocase {
namespace {

struct LookUp {
    const Session& session;
    const Exercise& exercise;
    const Anatomy* anatomy;
    const ScoreOptions& options;
    NeedleSight sight{anatomy, exercise};
    std::vector<bool> no_go = std::vector<bool>(256, false);  // # labels
    bool has_no_go = false;

    NeedleReading operator()(const TrackPoint& point) const {
        NeedleReading r;
        const Point3 tip = Point3{} + point.pose.translation;
        const Vector3 direction = point.pose.rotation.column(2);
        if (anatomy) read_in_body(point, tip, direction, &r);
        const SessionSample& sample = session.samples[point.sample];
        if (sample.probe_ok && is_finite(sample.mannequin_from_probe)) {
            r.seen = true;
            const Rigid probe_from_mannequin = inverse(sample.mannequin_from_probe);
            const Point3 t = probe_from_mannequin * tip;
            r.plane_mm = t.y;
            read_in_picture(sample.mannequin_from_probe, point.time_s, t,
                            probe_from_mannequin * direction,
                            probe_from_mannequin * point.pose.rotation.column(0), &r);
            if (sample.unseen) {
                r.tip_in_view = false;
                r.in_beam_mm = 0;
            }
        }
        return r;
    }

    // axis, bevel: of the needle, `probe` frame.
    void read_in_picture(const Rigid& pose,
                         double time_s,
                         Point3 tip,
                         Vector3 axis,
                         Vector3 bevel,
                         NeedleReading* r) const {
        r->tip_in_view = sight.tip_visible(pose, tip, axis, bevel, time_s);
        r->on_the_way = sight.on_the_way(tip, axis);
        if (!(r->depth_mm > 0)) return;
        const Point3 skin = tip - r->depth_mm * axis;
        r->in_beam_mm = sight.visible_mm(pose, tip, skin, time_s);
        r->in_sector_mm = sight.in_sector_mm(tip, skin);
    }

    void read_in_body(const TrackPoint& point,
                      Point3 tip,
                      Vector3 direction,
                      NeedleReading* r) const {
        r->inside = anatomy->inside(tip);
        r->ahead = anatomy->inside(tip + options.puncture_mm * direction);
        r->behind = anatomy->inside(tip - options.puncture_mm * direction);
        r->touches = r->inside || anatomy->inside(tip + options.contact_mm * direction);
        r->depth_mm =
            insertion_depth_mm(*anatomy, tip, direction, exercise.needle.length_mm, &r->skin);
        if (!has_no_go || !r->inside) return;
        for (double s = 0; s <= r->depth_mm && !r->no_go; s += options.shaft_step_mm) {
            const int label = anatomy->label(anatomy->at_rest(tip - s * direction, point.time_s));
            r->no_go = no_go[label];
        }
    }
};

}  // namespace

std::vector<NeedleReading> look_up_readings(const Session& session,
                                            const ToolTrack& needle,
                                            const Exercise& exercise,
                                            const Anatomy* anatomy,
                                            const std::vector<Label>& labels,
                                            const ScoreOptions& options) {
    LookUp look_up{session, exercise, anatomy, options};
    for (std::size_t i = 0; i < labels.size() && i < look_up.no_go.size(); ++i) {
        const bool spared = std::find(exercise.no_go.begin(), exercise.no_go.end(),
                                      labels[i].name) != exercise.no_go.end();
        look_up.no_go[i] = spared;
        look_up.has_no_go = look_up.has_no_go || spared;
    }
    std::vector<NeedleReading> readings(needle.points.size());
    constexpr std::size_t kBlock = 1024;
    JobRunner& jobs = options.jobs ? *options.jobs : serial_jobs();
    jobs.run((readings.size() + kBlock - 1) / kBlock, [&](std::size_t b) {
        const std::size_t end = std::min(readings.size(), (b + 1) * kBlock);
        for (std::size_t i = b * kBlock; i < end; ++i) readings[i] = look_up(needle.points[i]);
    });
    return readings;
}

}  // namespace sonocase

namespace sonocase::detail {
namespace {

// The number of separate periods in which touches(reading) holds; breaks of up to contact_pause_s
// do not separate two periods.
template <class Touches>
int contacts(const ScoreInput& input, Touches touches) {
    int count = 0;
    double last_s = -INFINITY;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        if (!touches(input.readings[i])) continue;
        const bool touched_before = i > 0 && touches(input.readings[i - 1]);
        if (!touched_before && input.time(i) - last_s > input.options.contact_pause_s) ++count;
        last_s = input.time(i);
    }
    return count;
}

}  // namespace

void score_motion(const std::string& tool,
                  const ToolTrack& track,
                  const MotionOptions& options,
                  MetricValues& values) {
    if (track.points.empty()) return;
    const MotionMetrics m = motion_metrics(track.points, options);
    values[tool + "elapsed_time_s"] = m.elapsed_time_s;
    values[tool + "path_length_mm"] = m.path_length_mm;
    values[tool + "filtered_path_length_mm"] = m.filtered_path_length_mm;
    values[tool + "average_velocity_mm_s"] = m.average_velocity_mm_s;
    values[tool + "motion_smoothness_mm_s3"] = m.motion_smoothness_mm_s3;
    values[tool + "path_inefficiency_percent"] = m.path_inefficiency_percent;
    values[tool + "translational_actions"] = m.translational_actions;
    values[tool + "rotational_actions"] = m.rotational_actions;
    values[tool + "rotation_total_deg"] = m.rotation_total_deg;
    values[tool + "bounding_box_mm3"] = m.bounding_box_mm3;
}

void score_tissue(const ScoreInput& input,
                  bool has_no_go,
                  MetricValues& values,
                  std::vector<Message>& warnings) {
    double axial = 0;
    for (std::size_t i = 1; i < input.readings.size(); ++i) {
        axial += std::abs(dot(input.tip(i) - input.tip(i - 1), input.direction(i)));
    }
    values["depth_perception_mm"] = axial;
    if (!input.anatomy) return;
    double path = 0, time_in = 0, damage = 0, no_go_s = 0, deepest = 0;
    int punctures = 0;
    bool punctured = false;
    const double length = input.exercise.needle.length_mm;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        deepest = std::max(deepest, r.depth_mm);
        if (!punctured && r.inside && r.ahead && r.behind) {
            ++punctures;
            punctured = true;
        } else if (punctured && !r.inside && !r.ahead && !r.behind) {
            punctured = false;
        }
        if (i == 0 || !r.inside) continue;
        path += distance(input.tip(i), input.tip(i - 1));
        time_in += input.step_s(i);
        if (r.no_go) no_go_s += input.step_s(i);
        const NeedleReading& before = input.readings[i - 1];
        if (!before.inside) continue;
        // The shaft swept the quadrilateral between its two inserted parts: two triangles.
        const Point3 end = input.tip(i) - std::min(r.depth_mm, length) * input.direction(i);
        const Point3 end_before =
            input.tip(i - 1) - std::min(before.depth_mm, length) * input.direction(i - 1);
        damage += 0.5 * norm(cross(input.tip(i) - input.tip(i - 1), end - input.tip(i - 1)));
        damage += 0.5 * norm(cross(end - input.tip(i - 1), end_before - input.tip(i - 1)));
    }
    values["path_in_tissue_mm"] = path;
    values["time_in_tissue_s"] = time_in;
    values["tissue_damage_mm2"] = damage;
    values["tissue_punctures"] = punctures;
    values["deepest_mm"] = deepest;
    values["skin_contacts"] = contacts(input, [](const NeedleReading& r) { return r.touches; });
    if (has_no_go || input.exercise.no_go.empty()) {
        values["no_go_contacts"] = contacts(input, [](const NeedleReading& r) { return r.no_go; });
        values["no_go_time_s"] = no_go_s;
    } else {
        warnings.push_back("The body has none of the structures to be spared.");
    }
}

namespace {

// Sets the final pose of an insertion from reading i, and the target nearest to it then.
void set_final_pose(const ScoreInput& input, std::size_t i, InsertionScore& s) {
    s.final_tip = input.tip(i);
    s.final_direction = input.direction(i);
    s.tip_to_target_mm = std::numeric_limits<double>::quiet_NaN();
    double nearest = INFINITY;
    for (std::size_t t = 0; t < input.exercise.targets.size(); ++t) {
        const Point3 centre = input.target_at(t, input.time(i));
        const double d = distance(s.final_tip, centre);
        if (d < nearest) {
            nearest = d;
            s.target = static_cast<int>(t);
            s.target_centre = centre;
            s.tip_to_target_mm = d;
        }
    }
}

}  // namespace

std::vector<InsertionScore> find_insertions(const ScoreInput& input) {
    std::vector<InsertionScore> insertions;
    if (!input.anatomy) return insertions;
    std::vector<std::size_t> deepest;  // reading of each insertion's greatest depth
    InsertionDetector detector(input.options.insertion);
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        const InsertionChange change =
            detector.update(input.time(i), r.depth_mm, input.direction(i), r.skin);
        if (change == InsertionChange::entered) {
            InsertionScore s;
            s.entry_s = detector.entry_time_s();
            s.entry = detector.entry_point();
            s.entry_direction = detector.entry_direction();
            s.still_in = true;
            insertions.push_back(s);
        }
        if (detector.inserted()) {
            InsertionScore& s = insertions.back();
            s.exit_s = input.time(i);
            const bool deeper = r.depth_mm > s.deepest_mm;
            if (deeper) {
                s.deepest_mm = r.depth_mm;
                s.deepest_s = input.time(i);
                deepest.resize(insertions.size());
                deepest.back() = i;
            }
        }
        if (change == InsertionChange::left) {
            insertions.back().exit_s = detector.exit_time_s();
            insertions.back().still_in = false;
        }
    }
    for (std::size_t k = 0; k < insertions.size(); ++k) {
        const bool still_in = insertions[k].still_in;
        set_final_pose(input, still_in ? input.readings.size() - 1 : deepest[k], insertions[k]);
    }
    return insertions;
}

namespace {

// Scores how the last insertion ended and how straight it was.
void score_last_insertion(const ScoreInput& input,
                          const std::vector<InsertionScore>& insertions,
                          MetricValues& values) {
    if (insertions.empty()) return;
    double error = 0;
    for (const InsertionScore& s : insertions) error += s.tip_to_target_mm;
    values["targeting_error_mm"] = error / static_cast<double>(insertions.size());
    const InsertionScore& last = insertions.back();
    values["final_tip_to_target_mm"] = last.tip_to_target_mm;
    const Vector3 line = last.target_centre - last.entry;
    if (!(norm(line) > 0)) return;
    const Vector3 u = normalized(line);
    // An arc tangent keeps full precision at small angles, where an arc cosine loses half of it.
    values["final_angle_deg"] = kDegPerRad * arc_tangent(norm(cross(last.final_direction, u)),
                                                         dot(last.final_direction, u));
    double greatest = 0, sum = 0, weight = 0;
    for (std::size_t i = 0; i < input.readings.size(); ++i) {
        if (!input.readings[i].inside || input.time(i) < last.entry_s ||
            input.time(i) > last.exit_s)
            continue;
        const double off = norm(cross(input.tip(i) - last.entry, u));
        greatest = std::max(greatest, off);
        sum += input.step_s(i) * off;
        weight += input.step_s(i);
    }
    values["trajectory_deviation_mm"] = greatest;
    if (weight > 0) values["trajectory_deviation_mean_mm"] = sum / weight;
}

}  // namespace

void score_targets_hit(const ScoreInput& input,
                       const std::vector<InsertionScore>& insertions,
                       MetricValues& values,
                       std::vector<TargetScore>& scores) {
    const std::vector<Target>& targets = input.exercise.targets;
    if (targets.empty()) return;
    TargetTree hits(targets);
    const double shift = input.target_shift_mm();
    int hit = 0;
    for (std::size_t i = 0; i < input.readings.size() && !hits.empty(); ++i) {
        const Point3 p = input.tip(i);
        hits.search([&](Point3 c, double radius) { return distance(c, p) <= radius + shift; },
                    [&](std::uint32_t t) {
                        const double d = distance(input.target_at(t, input.time(i)), p);
                        if (!(d <= targets[t].hit_radius_mm)) return false;
                        scores[t].first_hit_s = input.time(i);
                        ++hit;
                        return true;
                    });
    }
    values["targets_hit"] = hit;
    values["targets_hit_fraction"] = hit / static_cast<double>(targets.size());
    score_last_insertion(input, insertions, values);
}

void score_targets_scanned(const ScoreInput& input,
                           MetricValues& values,
                           std::vector<TargetScore>& scores) {
    if (input.probe.points.empty()) return;
    const Probe& probe = input.exercise.probe;
    const std::vector<Target>& targets = input.exercise.targets;
    if (targets.empty()) return;
    TargetTree centres(targets), parts(targets);
    const double reach = probe.depth_mm + std::max(probe.radius_mm, probe.width_mm);
    const double slack = input.options.target_slab_mm + input.target_shift_mm();
    int scanned = 0, seen = 0;
    for (const TrackPoint& point : input.probe.points) {
        if (centres.empty() && parts.empty()) break;
        if (input.session.samples[point.sample].unseen) continue;
        const Rigid probe_from = inverse(point.pose);
        const auto near = [&](Point3 c, double radius) {
            const Point3 p = probe_from * c;
            return std::abs(p.y) <= radius + slack &&
                   hypotenuse(p.x, p.z) <= reach + radius + slack;
        };
        centres.search(near, [&](std::uint32_t t) {
            const Point3 p = probe_from * input.target_at(t, point.time_s);
            if (!(std::abs(p.y) < input.options.target_slab_mm) || !in_image(probe, p.x, p.z))
                return false;
            scores[t].first_scanned_s = point.time_s;
            ++scanned;
            return true;
        });
        parts.search(near, [&](std::uint32_t t) {
            const Point3 p = probe_from * input.target_at(t, point.time_s);
            const double radius = targets[t].radius_mm;
            if (!(std::abs(p.y) <= radius)) return false;
            const double in_plane = std::sqrt(radius * radius - p.y * p.y);
            if (!(distance_to_image(probe, p.x, p.z) <= in_plane)) return false;
            scores[t].first_seen_s = point.time_s;
            ++seen;
            return true;
        });
    }
    const double count = static_cast<double>(targets.size());
    values["targets_scanned_percent"] = 100 * scanned / count;
    values["structures_scanned_percent"] = 100 * seen / count;
}

void score_guidance(const ScoreInput& input, MetricValues& values) {
    if (!input.anatomy || input.probe.points.empty()) return;
    double in_beam = 0, in_sector = 0, seconds = 0, view_s = 0, plane = 0, plane_max = 0, angle = 0;
    double advance = 0, advance_in_view = 0;
    for (std::size_t i = 1; i < input.readings.size(); ++i) {
        const NeedleReading& r = input.readings[i];
        if (!r.inside || !r.seen) continue;
        const double dt = input.step_s(i);
        in_beam += dt * r.in_beam_mm;
        in_sector += dt * r.in_sector_mm;
        seconds += dt;
        if (r.tip_in_view) view_s += dt;
        plane += dt * std::abs(r.plane_mm);
        plane_max = std::max(plane_max, std::abs(r.plane_mm));
        const Vector3 normal = input.session.samples[input.needle.points[i].sample]
                                   .mannequin_from_probe.rotation.column(1);
        const double sine = std::min(std::abs(dot(normal, input.direction(i))), 1.0);
        angle += dt * kDegPerRad * arc_tangent(sine, std::sqrt((1 - sine) * (1 + sine)));
        const double forward =
            std::max(dot(input.tip(i) - input.tip(i - 1), input.direction(i)), 0.0);
        if (!r.on_the_way) advance += forward;
        if (r.tip_in_view) advance_in_view += forward;
    }
    if (!(seconds > 0)) return;
    if (in_sector > 0) values["needle_in_beam_fraction"] = in_beam / in_sector;
    values["needle_in_beam_mm"] = in_beam / seconds;
    values["tip_in_view_fraction"] = view_s / seconds;
    if (advance > 0) values["tip_in_view_at_advance_fraction"] = advance_in_view / advance;
    values["needle_plane_distance_mean_mm"] = plane / seconds;
    values["needle_plane_distance_max_mm"] = plane_max;
    values["needle_plane_angle_mean_deg"] = angle / seconds;
}

void score_probe_use(const ScoreInput& input, MetricValues& values) {
    const std::vector<TrackPoint>& points = input.probe.points;
    if (!input.anatomy || points.empty()) return;
    double usage_s = 0;
    for (std::size_t i = 1; i < points.size(); ++i) {
        if (probe_on_skin(*input.anatomy, input.exercise.probe, points[i].pose))
            usage_s += points[i].time_s - points[i - 1].time_s;
    }
    values["probe_usage_time_s"] = usage_s;
}

namespace {

// Shares of a vein's area at rest: below the first it counts as closed, above the second as open.
constexpr double kClosed = 0.1, kOpen = 0.5;

void score_force(const ScoreInput& input, MetricValues& values) {
    double pressed_s = 0, over_s = 0, force_sum = 0, pressure_sum = 0, greatest = 0;
    double before_s = 0;
    bool first = true;
    for (const SessionSample& sample : input.session.samples) {
        if (!sample.has_press || !sample.probe_ok) continue;
        const double step_s = first ? 0 : std::max(sample.time_s - before_s, 0.0);
        first = false;
        before_s = sample.time_s;
        greatest = std::max(greatest, sample.press.force_n);
        if (!(sample.press.force_n > 0)) continue;
        pressed_s += step_s;
        force_sum += step_s * sample.press.force_n;
        pressure_sum += step_s * sample.press.pressure_kpa;
        if (sample.press.force_n > input.exercise.deformation.force_limit_n) over_s += step_s;
    }
    values["probe_force_max_n"] = greatest;
    values["probe_force_mean_n"] = pressed_s > 0 ? force_sum / pressed_s : 0;
    values["probe_pressure_mean_kpa"] = pressed_s > 0 ? pressure_sum / pressed_s : 0;
    values["press_time_over_limit_s"] = over_s;
}

// How often the veins under the face were closed and opened again.
double compressions(const Session& session) {
    int done = 0;
    bool closed = false;
    for (const SessionSample& sample : session.samples) {
        if (!sample.has_press) continue;
        const double open = sample.press.vein_open;
        if (open >= 0 && open < kClosed) closed = true;
        const bool lifted = !(sample.press.force_n > 0);
        if (closed && (lifted || open > kOpen)) {
            ++done;
            closed = false;
        }
    }
    return done;
}

const SessionSample* sample_at(const Session& session, std::int64_t frame) {
    for (const SessionSample& sample : session.samples) {
        if (sample.frame == frame) return &sample;
    }
    return nullptr;
}

void score_vessels(const ScoreInput& input, MetricValues& values) {
    double posterior = 0;
    std::optional<std::string> vessel;  // the first that was punctured
    for (const SessionEvent& event : input.session.events) {
        if (event.name == "posterior_wall") ++posterior;
        if (event.name != "tissue_puncture" || vessel) continue;
        const std::string label = detail_value(event.detail, "label");
        const Vessel kind = vessel_of_label(label);
        if (kind == Vessel::unknown) continue;
        vessel = label;
        const SessionSample* sample = sample_at(input.session, event.frame);
        if (kind != Vessel::vein || sample == nullptr) continue;
        const double open = sample->press.vein_open;
        values["vein_collapse_at_puncture_percent"] =
            open >= 0 ? 100 * (1 - std::min(open, 1.0)) : 0;
    }
    values["posterior_wall_punctures"] = posterior;
    if (!vessel) return;
    bool any = false, right = false;
    for (const Target& target : input.exercise.targets) {
        if (vessel_of_label(target.inside) == Vessel::unknown) continue;
        any = true;
        right = right || target.inside == *vessel;
    }
    if (any) values["correct_vessel_punctured"] = right ? 1 : 0;
}

}  // namespace

void score_press(const ScoreInput& input, MetricValues& values) {
    const auto& samples = input.session.samples;
    if (std::none_of(samples.begin(), samples.end(),
                     [](const SessionSample& sample) { return sample.has_press; }))
        return;
    score_force(input, values);
    values["compressions_done"] = compressions(input.session);
    if (!input.needle.points.empty()) score_vessels(input, values);
}

namespace {

constexpr double kShownS = 1;  // time in colour that counts as shown: more than a beat
constexpr int kMinBeats = 2;

bool among(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

// Whether Doppler found flow in it, which is enough to make the tube of a phantom a vessel.
bool has_flow(const Session& session, const std::string& label) {
    return std::any_of(session.samples.begin(), session.samples.end(), [&](const auto& sample) {
        return sample.has_doppler &&
               (sample.doppler.gate == label || among(sample.doppler.coloured, label));
    });
}

// The vessels in which targets lie, each once.
std::vector<std::string> wanted_vessels(const Exercise& exercise, const Session& session) {
    std::vector<std::string> wanted;
    for (const Target& target : exercise.targets) {
        if (target.inside.empty() || among(wanted, target.inside)) continue;
        if (vessel_of_label(target.inside) != Vessel::unknown || has_flow(session, target.inside))
            wanted.push_back(target.inside);
    }
    return wanted;
}

struct DopplerUse {
    std::map<std::string, double> coloured_s;       // of each vessel
    std::map<std::string, DopplerSample> measured;  // the last measurement in each
    double gate_s = 0, filled_s = 0;                // spectral time; share of it in a wanted vessel
};

DopplerUse doppler_use(const Session& session, const std::vector<std::string>& wanted) {
    DopplerUse out;
    const SessionSample* before = nullptr;
    for (const SessionSample& sample : session.samples) {
        const double step_s = before != nullptr ? std::max(sample.time_s - before->time_s, 0.0) : 0;
        before = &sample;
        if (!sample.has_doppler) continue;
        const DopplerSample& d = sample.doppler;
        for (const std::string& vessel : d.coloured) out.coloured_s[vessel] += step_s;
        // Only frames of a spectral mode have a gate or a cursor.
        if (d.gate.empty() && d.cursor_deg == 0) continue;
        out.gate_s += step_s;
        if (among(wanted, d.gate)) out.filled_s += step_s * d.gate_fill;
        if (!d.gate.empty() && d.beats >= kMinBeats) out.measured[d.gate] = d;
    }
    return out;
}

}  // namespace

void score_doppler(const ScoreInput& input, MetricValues& values) {
    const auto& samples = input.session.samples;
    if (std::none_of(samples.begin(), samples.end(),
                     [](const SessionSample& sample) { return sample.has_doppler; }))
        return;
    const std::vector<std::string> wanted = wanted_vessels(input.exercise, input.session);
    const DopplerUse seen = doppler_use(input.session, wanted);
    double shown = 0, measured = 0, angle = 0, cursor = 0, error = 0;
    for (const std::string& vessel : wanted) {
        const auto colour = seen.coloured_s.find(vessel);
        if (colour != seen.coloured_s.end() && colour->second >= kShownS) ++shown;
        const auto found = seen.measured.find(vessel);
        if (found == seen.measured.end()) continue;
        const DopplerSample& d = found->second;
        ++measured;
        angle = std::max(angle, d.angle_deg);
        cursor = std::max(cursor, std::abs(d.cursor_deg - d.angle_deg));
        if (d.true_psv_cm_s > 0)
            error = std::max(error, 100 * std::abs(d.psv_cm_s / d.true_psv_cm_s - 1));
    }
    values["vessels_shown_in_colour"] = shown;
    values["vessels_measured"] = measured;
    if (seen.gate_s > 0) values["gate_in_vessel_fraction"] = seen.filled_s / seen.gate_s;
    if (!seen.measured.empty() && !wanted.empty())
        values["correct_vessel_measured"] =
            std::all_of(seen.measured.begin(), seen.measured.end(),
                        [&](const auto& one) { return among(wanted, one.first); });
    if (measured == 0) return;
    values["doppler_angle_max_deg"] = angle;
    values["angle_cursor_error_deg"] = cursor;
    values["peak_velocity_error_percent"] = error;
}

}  // namespace sonocase::detail
