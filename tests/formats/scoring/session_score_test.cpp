// SPDX-License-Identifier: Apache-2.0

// Scores against an independent slow computation in long double, straight from docs/metrics.md.
#include "formats/scoring/session_score.h"

#include <gtest/gtest.h>

#include <map>

#include "ball.h"
#include "formats/scoring/image_region.h"
#include "formats/threads/thread_jobs.h"
#include "support/random.h"

namespace sonocase {
namespace {

using testing::Ball;
using testing::BreathingBall;
using Real = long double;

constexpr Real kPi = 3.14159265358979323846L;
const std::vector<Label> kLabels{
    {"outside", "", 0, {}}, {"body", "", 1, {}}, {"vessel", "", 2, {}}};

struct Scene {
    Session session;
    Exercise exercise;
    Point3 centre, vessel;
    double radius = 0, vessel_radius = 0;
    BreathingBall::Motion motion;  // none unless it breathes
    BreathingBall body() const {
        return BreathingBall(Ball(centre, radius, vessel, vessel_radius), motion);
    }
};

Scene random_scene(std::uint64_t seed, bool breathes) {
    testing::Random random(seed);
    Scene s;
    s.centre = random.point(30);
    s.radius = random.uniform(60, 120);
    s.vessel = s.centre + 0.5 * s.radius * random.direction();
    s.vessel_radius = random.uniform(5, 20);
    Exercise& e = s.exercise;
    e.name = "random";
    e.probe.shape = static_cast<ProbeShape>(seed % 3);
    e.probe.depth_mm = random.uniform(60, 180);
    e.probe.elevation_mm = random.uniform(1, 8);
    e.needle.slab_mm = random.uniform(0, 6);
    e.needle.length_mm = random.uniform(100, 200);
    e.no_go = {"vessel"};
    for (int t = 0; t < 6; ++t) {
        Target target;
        target.centre = s.centre + random.uniform(0, s.radius) * random.direction();
        target.radius_mm = random.uniform(1, 15);
        target.hit_radius_mm = random.uniform(1, 15);
        e.targets.push_back(target);
    }
    // The needle wanders in and out along slowly turning directions; the probe wanders on the skin.
    double t = random.uniform(0, 50);
    Vector3 axis = random.direction(), probe_out = random.direction();
    if (breathes) {
        s.motion.amplitude_mm = random.uniform(3, 20) * random.direction();
        s.motion.slope_per_mm = 2e-3 * random.direction();
        s.motion.middle = s.centre;
        s.motion.period_s = random.uniform(2, 8);
    }
    double depth = -20, speed = 0;
    for (int i = 0; i < 700; ++i) {
        axis = normalized(axis + 0.02 * random.direction());
        probe_out = normalized(probe_out + 0.05 * random.direction());
        speed = 0.95 * speed + 2 * random.gaussian() + (depth < -15 ? 3 : depth > 60 ? -3 : 0.1);
        depth += 0.5 * speed;
        SessionSample sample;
        sample.time_s = t;
        sample.frame = i;
        sample.needle_ok = random.uniform(0, 1) > 0.03;
        sample.probe_ok = random.uniform(0, 1) > 0.03;
        const Point3 tip = s.centre + (s.radius - depth) * axis + 0.2 * random.direction();
        sample.mannequin_from_drawn =
            testing::needle_at(tip, normalized(-axis + 0.1 * random.direction()));
        sample.mannequin_from_needle = sample.mannequin_from_drawn;
        const Vector3 z = normalized(-probe_out + 0.3 * random.direction()),
                      x = normalized(cross(axis, z));
        sample.mannequin_from_probe = {
            Matrix3::from_columns(x, cross(z, x), z),
            s.centre + (s.radius + random.uniform(-2, 3)) * probe_out - Point3{}};
        s.session.samples.push_back(sample);
        t += random.uniform(0.01, 0.1);
    }
    return s;
}

struct V {
    Real x, y, z;
};
V v(Point3 p) {
    return {p.x, p.y, p.z};
}
V v(Vector3 p) {
    return {p.x, p.y, p.z};
}
V sub(V a, V b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
V add(V a, V b, Real s) {
    return {a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
Real dot3(V a, V b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
Real len(V a) {
    return std::sqrt(dot3(a, a));
}
Point3 narrow(V a) {
    return {static_cast<double>(a.x), static_cast<double>(a.y), static_cast<double>(a.z)};
}

std::map<std::string, Real> slow_scores(const Scene& s) {
    const Exercise& e = s.exercise;
    const Real slab =
        std::max(e.needle.slab_mm > 0 ? e.needle.slab_mm : needle_diameter_mm(e.needle),
                 e.probe.elevation_mm);
    const V centre = v(s.centre), vessel = v(s.vessel);
    const auto swing = [&](Real t) { return v(s.motion.swing(static_cast<double>(t))); };
    const V slope = v(s.motion.slope_per_mm);
    const auto weight = [&](V p) { return Real(0.7) + dot3(slope, sub(p, v(s.motion.middle))); };
    const auto at_rest = [&](V p, Real t) { return add(p, swing(t), -weight(p)); };
    // Where a target is: the point whose place at rest is its centre, by Newton's method.
    const auto target_at = [&](const Target& target, Real t) {
        const V rest = v(target.centre), way = swing(t);
        Real step = 0;
        for (int i = 0; i < 50; ++i) {
            const Real off = weight(add(rest, way, step)) - step;
            step += off / (1 - dot3(slope, way));
        }
        return add(rest, way, step);
    };
    const auto inside = [&](V p) { return len(sub(p, centre)) < s.radius; };
    struct R {
        Real t, depth, ahead;
        V tip, dir, end;
        bool in, touches, no_go, seen, view;
        Real plane, beam, forward_dt;
        const SessionSample* sample;
    };
    std::vector<R> r;
    for (const SessionSample& sample : s.session.samples) {
        if (!sample.needle_ok) continue;
        R q{};
        q.sample = &sample;
        q.t = sample.time_s;
        q.tip = v(sample.mannequin_from_drawn.translation);
        q.dir = v(sample.mannequin_from_drawn.rotation.column(2));
        q.in = inside(q.tip);
        q.touches = q.in || inside(add(q.tip, q.dir, 1));
        if (q.in) {
            // Where the line back leaves the ball: |tip - s dir - c| = radius.
            const V w = sub(q.tip, centre);
            const Real b = -dot3(w, q.dir);
            q.depth = std::min<Real>(
                e.needle.length_mm, -b + std::sqrt(b * b - dot3(w, w) + Real(s.radius) * s.radius));
            for (int k = 0; k <= q.depth; ++k) {
                const V p = at_rest(add(q.tip, q.dir, -k), q.t);
                q.no_go = q.no_go || (inside(p) && len(sub(p, vessel)) < s.vessel_radius);
            }
        }
        q.end = add(q.tip, q.dir, -q.depth);
        // How far ahead the skin is, in steps of half a millimetre.
        if (!q.in) q.ahead = 10;
        for (int k = 19; k >= 0 && !q.in; --k) {
            if (inside(add(q.tip, q.dir, Real(k) / 2))) q.ahead = Real(k) / 2;
        }
        if (sample.probe_ok) {
            q.seen = true;
            const Rigid from = inverse(sample.mannequin_from_probe);
            const Point3 t = from * narrow(q.tip);
            q.plane = t.y;
            q.view = std::abs(t.y) <= slab / 2 && in_image(e.probe, t.x, t.z);
            if (q.in)
                q.beam = length_in_image(e.probe, t, from * narrow(q.end),
                                         static_cast<double>(slab / 2));
        }
        r.push_back(q);
    }
    std::map<std::string, Real> m;
    m["depth_perception_mm"] = m["path_in_tissue_mm"] = m["time_in_tissue_s"] =
        m["tissue_damage_mm2"] = 0;
    m["no_go_time_s"] = m["deepest_mm"] = m["needle_plane_distance_max_mm"] = 0;
    Real beam = 0, inserted = 0, seconds = 0, view = 0, plane = 0, angle = 0, advance = 0,
         advance_view = 0;
    for (std::size_t i = 0; i < r.size(); ++i) {
        m["deepest_mm"] = std::max(m["deepest_mm"], r[i].depth);
        if (i == 0) continue;
        const Real dt = r[i].t - r[i - 1].t;
        const V step = sub(r[i].tip, r[i - 1].tip);
        m["depth_perception_mm"] += std::abs(dot3(step, r[i].dir));
        if (!r[i].in) continue;
        m["path_in_tissue_mm"] += len(step);
        m["time_in_tissue_s"] += dt;
        if (r[i].no_go) m["no_go_time_s"] += dt;
        if (r[i - 1].in) {
            // Heron's formula, as the trainers that define this measure use it.
            const auto heron = [](V a, V b, V c) {
                const Real x = len(sub(a, b)), y = len(sub(b, c)), z = len(sub(c, a)),
                           h = (x + y + z) / 2;
                return std::sqrt(std::max<Real>(h * (h - x) * (h - y) * (h - z), 0));
            };
            m["tissue_damage_mm2"] += heron(r[i].tip, r[i - 1].tip, r[i].end) +
                                      heron(r[i].end, r[i - 1].tip, r[i - 1].end);
        }
        if (!r[i].seen) continue;
        beam += dt * r[i].beam;
        inserted += dt * r[i].depth;
        seconds += dt;
        view += r[i].view ? dt : 0;
        plane += dt * std::abs(r[i].plane);
        m["needle_plane_distance_max_mm"] =
            std::max(m["needle_plane_distance_max_mm"], std::abs(r[i].plane));
        const V normal = v(r[i].sample->mannequin_from_probe.rotation.column(1));
        angle += dt * std::asin(std::abs(dot3(normal, r[i].dir))) * 180 / kPi;
        const Real forward = std::max<Real>(dot3(step, r[i].dir), 0);
        advance += forward;
        advance_view += r[i].view ? forward : 0;
    }
    m["needle_in_beam_fraction"] = beam / inserted;
    m["needle_in_beam_mm"] = beam / seconds;
    m["tip_in_view_fraction"] = view / seconds;
    m["tip_in_view_at_advance_fraction"] = advance_view / advance;
    m["needle_plane_distance_mean_mm"] = plane / seconds;
    m["needle_plane_angle_mean_deg"] = angle / seconds;
    const auto contacts = [&](auto touches) {
        int count = 0;
        Real last = -1e30L;
        for (std::size_t i = 0; i < r.size(); ++i) {
            if (!touches(r[i])) continue;
            const bool keep_session = i > 0 && touches(r[i - 1]);
            if (!keep_session && r[i].t - last > 0.25L) ++count;
            last = r[i].t;
        }
        return count;
    };
    m["skin_contacts"] = contacts([](const R& q) { return q.touches; });
    m["no_go_contacts"] = contacts([](const R& q) { return q.no_go; });
    int punctures = 0;
    bool in = false;
    for (const R& q : r) {
        const int n = inside(q.tip) + inside(add(q.tip, q.dir, 5)) + inside(add(q.tip, q.dir, -5));
        if (!in && n == 3) ++punctures;
        in = n == 3 || (in && n != 0);
    }
    m["tissue_punctures"] = punctures;
    int hit = 0, scanned = 0, part = 0;
    for (const Target& target : e.targets) {
        bool h = false, c = false, p = false;
        for (const R& q : r) {
            h = h || len(sub(q.tip, target_at(target, q.t))) <= target.hit_radius_mm;
        }
        for (const SessionSample& sample : s.session.samples) {
            if (!sample.probe_ok) continue;
            const Point3 x =
                inverse(sample.mannequin_from_probe) * narrow(target_at(target, sample.time_s));
            c = c || (std::abs(x.y) < 5 && in_image(e.probe, x.x, x.z));
            const double rr = target.radius_mm * target.radius_mm - x.y * x.y;
            p = p || (rr >= 0 && distance_to_image(e.probe, x.x, x.z) <= std::sqrt(rr));
        }
        hit += h;
        scanned += c;
        part += p;
    }
    m["targets_hit"] = hit;
    m["targets_scanned_percent"] = Real(100) * scanned / static_cast<Real>(e.targets.size());
    m["structures_scanned_percent"] = Real(100) * part / static_cast<Real>(e.targets.size());
    m["targets_hit_fraction"] = hit / static_cast<Real>(e.targets.size());

    // Insertions as intervals of readings [entry, end), found by looking back and ahead.
    struct Insertion {
        std::size_t entry, last;  // last: reading in the body, or the first out of it
        bool still_in;
    };
    std::vector<Insertion> insertions;
    for (std::size_t i = 0; i < r.size(); ++i) {
        if (r[i].depth < 2) continue;
        Insertion n{i, r.size() - 1, true};
        while (n.entry > 0 && r[n.entry - 1].depth > 0) --n.entry;
        std::size_t k = i;
        for (; k < r.size() && n.still_in; ++k) {
            if (r[k].in) continue;
            std::size_t out = k;
            while (out > i && !r[out - 1].in) --out;
            if (r[k].ahead < 3 && r[k].t - r[out].t < 0.25L) continue;
            n.still_in = false;
            n.last = out;
        }
        insertions.push_back(n);
        i = n.still_in ? r.size() : k - 1;
    }
    m["insertions"] = static_cast<Real>(insertions.size());
    Real error = 0;
    for (const Insertion& n : insertions) {
        std::size_t final_at = n.last;
        if (!n.still_in) {
            final_at = n.entry;
            for (std::size_t i = n.entry; i < n.last; ++i) {
                if (r[i].depth > r[final_at].depth) final_at = i;
            }
        }
        const R& last = r[final_at];
        V target{};
        Real nearest = 1e30L;
        for (const Target& t : e.targets) {
            const V at = target_at(t, last.t);
            if (len(sub(at, last.tip)) >= nearest) continue;
            nearest = len(sub(at, last.tip));
            target = at;
        }
        error += nearest;
        m["final_tip_to_target_mm"] = nearest;
        const V way = sub(target, r[n.entry].end);
        const Real distance = len(way);
        m["final_angle_deg"] = std::acos(dot3(last.dir, way) / distance) * 180 / kPi;
        Real greatest = 0, sum = 0, time = 0;
        for (std::size_t i = n.entry; i <= n.last; ++i) {
            if (!r[i].in) continue;
            // Pythagoras, where the program takes the cross product.
            const V from = sub(r[i].tip, r[n.entry].end);
            const Real along = dot3(from, way) / distance;
            const Real off = std::sqrt(std::max<Real>(dot3(from, from) - along * along, 0));
            greatest = std::max(greatest, off);
            const Real dt = i == 0 ? 0 : r[i].t - r[i - 1].t;
            sum += dt * off;
            time += dt;
        }
        m["trajectory_deviation_mm"] = greatest;
        m["trajectory_deviation_mean_mm"] = sum / time;
    }
    m["targeting_error_mm"] = error / static_cast<Real>(insertions.size());

    // Five points of the face, pressed in by 2 mm; intervals of the probe's own readings.
    const SessionSample* before = nullptr;
    m["probe_usage_time_s"] = 0;
    for (const SessionSample& sample : s.session.samples) {
        if (!sample.probe_ok) continue;
        bool touches = false;
        for (int k = -2; k <= 2; ++k) {
            Real x = k * e.probe.width_mm / 4, z = 2;
            if (e.probe.shape == ProbeShape::curvilinear) {
                const Real turn = k * e.probe.field_of_view_rad / 4;
                x = e.probe.radius_mm * std::sin(turn);
                z = 2 + e.probe.radius_mm * (std::cos(turn) - 1);
            }
            const Matrix3& axes = sample.mannequin_from_probe.rotation;
            touches =
                touches ||
                inside(add(add(v(sample.mannequin_from_probe.translation), v(axes.column(0)), x),
                           v(axes.column(2)), z));
        }
        if (touches && before)
            m["probe_usage_time_s"] += Real(sample.time_s) - Real(before->time_s);
        before = &sample;
    }
    return m;
}

void expect_slow_scores(const Scene& scene, std::uint64_t seed) {
    const BreathingBall body = scene.body();
    const SessionScore score = score_session(scene.session, scene.exercise, &body, kLabels);
    for (const auto& [name, slow] : slow_scores(scene)) {
        const double value = score.value(name);
        EXPECT_NEAR(value, static_cast<double>(slow),
                    1e-9 * std::max<double>(1e-3, std::abs(static_cast<double>(slow))))
            << name << " seed " << seed;
    }
    EXPECT_GT(score.value("insertions"), 1) << seed;
}

TEST(SessionScore, AgreesWithASlowComputationOnRandomSessions) {
    for (std::uint64_t seed = 1; seed <= 30; ++seed)
        expect_slow_scores(random_scene(seed, false), seed);
}

TEST(SessionScore, AgreesWithASlowComputationWhereTheAnatomyBreathes) {
    for (std::uint64_t seed = 1; seed <= 30; ++seed)
        expect_slow_scores(random_scene(seed, true), seed);
}

TEST(SessionScore, DoesNotDependOnThreads) {
    const Scene scene = random_scene(99, true);
    const BreathingBall body = scene.body();
    ThreadJobs four_threads(4);
    ScoreOptions one, four;
    four.jobs = &four_threads;
    EXPECT_EQ(score_json(score_session(scene.session, scene.exercise, &body, kLabels, one),
                         scene.exercise),
              score_json(score_session(scene.session, scene.exercise, &body, kLabels, four),
                         scene.exercise));
}

}  // namespace
}  // namespace sonocase
