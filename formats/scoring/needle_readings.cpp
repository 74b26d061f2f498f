// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/needle_readings.h"

#include <algorithm>
#include <cmath>

#include "formats/scoring/image_region.h"
#include "formats/scoring/sight.h"

namespace sonocase {
namespace {

struct LookUp {
    const Session& session;
    const Exercise& exercise;
    const Anatomy* anatomy;
    const ScoreOptions& options;
    double half_slab_mm = 0;
    std::vector<bool> no_go = std::vector<bool>(256, false);  // # labels
    bool has_no_go = false;

    NeedleReading operator()(const TrackPoint& point) const {
        NeedleReading r;
        const Point3 tip = Point3{} + point.pose.translation;
        const Vector3 direction = point.pose.rotation.column(2);
        if (anatomy) look_in_body(point, tip, direction, &r);
        const SessionSample& sample = session.samples[point.sample];
        if (sample.probe_ok && is_finite(sample.mannequin_from_probe)) {
            r.seen = true;
            const Rigid probe_from_mannequin = inverse(sample.mannequin_from_probe);
            const Point3 t = probe_from_mannequin * tip;
            r.plane_mm = t.y;
            r.tip_in_view = std::abs(t.y) <= half_slab_mm && in_image(exercise.probe, t.x, t.z);
            if (anatomy) look_along_beams(sample, point.time_s, t, direction, &r);
        }
        return r;
    }

    // What of the needle sound reaches.
    void look_along_beams(const SessionSample& sample,
                          double time_s,
                          Point3 tip_probe,
                          Vector3 direction,
                          NeedleReading* r) const {
        const Rigid& pose = sample.mannequin_from_probe;
        r->tip_in_view =
            r->tip_in_view && sound_reaches(*anatomy, exercise.probe, pose, tip_probe, time_s);
        if (!(r->depth_mm > 0)) return;
        const Vector3 back = transpose(pose.rotation) * direction;
        const Point3 skin = tip_probe - r->depth_mm * back;
        r->in_beam_mm =
            visible_length(*anatomy, exercise.probe, pose, tip_probe, skin, half_slab_mm, time_s);
    }

    void look_in_body(const TrackPoint& point,
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
            r->no_go = no_go[static_cast<std::size_t>(label)];
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
    const double slab =
        exercise.needle.slab_mm > 0 ? exercise.needle.slab_mm : needle_diameter_mm(exercise.needle);
    look_up.half_slab_mm = 0.5 * std::max(slab, exercise.probe.elevation_mm);
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
