// SPDX-License-Identifier: Apache-2.0

#include "slow_scores.h"

#include "formats/scoring/sight.h"

namespace sonocase::testing {
namespace {

constexpr Real kPi = 3.14159265358979323846L;
using Scores = std::map<std::string, Real>;

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

// The ball, its vessel and its motion.
struct Geometry {
    const Scene& s;
    V centre = v(s.centre), vessel = v(s.vessel), slope = v(s.motion.slope_per_mm);

    V swing(Real t) const { return v(s.motion.swing(static_cast<double>(t))); }
    Real weight(V p) const { return Real(0.7) + dot3(slope, sub(p, v(s.motion.middle))); }
    V at_rest(V p, Real t) const { return add(p, swing(t), -weight(p)); }
    bool inside(V p) const { return len(sub(p, centre)) < s.radius; }
    // Where a target is: the point whose place at rest is its centre, by Newton's method.
    V target_at(const Target& target, Real t) const {
        const V rest = v(target.centre), way = swing(t);
        Real step = 0;
        for (int i = 0; i < 50; ++i) {
            const Real off = weight(add(rest, way, step)) - step;
            step += off / (1 - dot3(slope, way));
        }
        return add(rest, way, step);
    }
};

// A reading of the needle.
struct R {
    Real t, depth, ahead;
    V tip, dir, end;
    bool in, touches, no_go, seen, view, on_the_way;
    Real plane, beam, sector, forward_dt;
    const SessionSample* sample;
};

std::vector<R> readings_of(const Scene& s, const Geometry& g) {
    const Exercise& e = s.exercise;
    const Real slab = e.needle.slab_mm > 0 ? e.needle.slab_mm : e.probe.elevation_mm;
    std::vector<R> r;
    for (const SessionSample& sample : s.session.samples) {
        if (!sample.needle_ok) continue;
        R q{};
        q.sample = &sample;
        q.t = sample.time_s;
        q.tip = v(sample.mannequin_from_drawn.translation);
        q.dir = v(sample.mannequin_from_drawn.rotation.column(2));
        q.in = g.inside(q.tip);
        q.touches = q.in || g.inside(add(q.tip, q.dir, 1));
        if (q.in) {
            // Where the line back leaves the ball: |tip - s dir - c| = radius.
            const V w = sub(q.tip, g.centre);
            const Real b = -dot3(w, q.dir);
            q.depth = std::min<Real>(
                e.needle.length_mm, -b + std::sqrt(b * b - dot3(w, w) + Real(s.radius) * s.radius));
            for (int k = 0; k <= q.depth; ++k) {
                const V p = g.at_rest(add(q.tip, q.dir, -k), q.t);
                q.no_go = q.no_go || (g.inside(p) && len(sub(p, g.vessel)) < s.vessel_radius);
            }
        }
        q.end = add(q.tip, q.dir, -q.depth);
        // How far ahead the skin is, in steps of half a millimetre.
        if (!q.in) q.ahead = 10;
        for (int k = 19; k >= 0 && !q.in; --k) {
            if (g.inside(add(q.tip, q.dir, Real(k) / 2))) q.ahead = Real(k) / 2;
        }
        if (sample.probe_ok) {
            q.seen = true;
            const Rigid from = inverse(sample.mannequin_from_probe);
            const Point3 t = from * narrow(q.tip);
            q.plane = t.y;
            q.view = std::abs(t.y) <= slab / 2 && in_image(e.probe, t.x, t.z);
            const double half = static_cast<double>(slab / 2);
            q.on_the_way =
                !in_image(e.probe, t.x, t.z) &&
                length_in_image(e.probe, t, from * narrow(add(q.tip, q.dir, e.needle.length_mm)),
                                half) > 0;
            if (q.in) {
                q.beam = length_in_image(e.probe, t, from * narrow(q.end), half);
                q.sector = length_in_image(e.probe, t, from * narrow(q.end), 1e9);
            }
        }
        r.push_back(q);
    }
    return r;
}

// Sums over the readings in tissue.
void add_guidance(const std::vector<R>& r, Scores& m) {
    m["depth_perception_mm"] = m["path_in_tissue_mm"] = m["time_in_tissue_s"] =
        m["tissue_damage_mm2"] = 0;
    m["no_go_time_s"] = m["deepest_mm"] = m["needle_plane_distance_max_mm"] = 0;
    Real beam = 0, sector = 0, seconds = 0, view = 0, plane = 0, angle = 0, advance = 0,
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
        sector += dt * r[i].sector;
        seconds += dt;
        view += r[i].view ? dt : 0;
        plane += dt * std::abs(r[i].plane);
        m["needle_plane_distance_max_mm"] =
            std::max(m["needle_plane_distance_max_mm"], std::abs(r[i].plane));
        const V normal = v(r[i].sample->mannequin_from_probe.rotation.column(1));
        angle += dt * std::asin(std::abs(dot3(normal, r[i].dir))) * 180 / kPi;
        const Real forward = std::max<Real>(dot3(step, r[i].dir), 0);
        advance += r[i].on_the_way ? 0 : forward;
        advance_view += r[i].view ? forward : 0;
    }
    m["needle_in_beam_fraction"] = beam / sector;
    m["needle_in_beam_mm"] = beam / seconds;
    m["tip_in_view_fraction"] = view / seconds;
    m["tip_in_view_at_advance_fraction"] = advance_view / advance;
    m["needle_plane_distance_mean_mm"] = plane / seconds;
    m["needle_plane_angle_mean_deg"] = angle / seconds;
}

void add_contacts(const std::vector<R>& r, const Geometry& g, Scores& m) {
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
        const int n =
            g.inside(q.tip) + g.inside(add(q.tip, q.dir, 5)) + g.inside(add(q.tip, q.dir, -5));
        if (!in && n == 3) ++punctures;
        in = n == 3 || (in && n != 0);
    }
    m["tissue_punctures"] = punctures;
}

void add_targets(const Scene& s, const std::vector<R>& r, const Geometry& g, Scores& m) {
    const Exercise& e = s.exercise;
    int hit = 0, scanned = 0, part = 0;
    for (const Target& target : e.targets) {
        bool h = false, c = false, p = false;
        for (const R& q : r) {
            h = h || len(sub(q.tip, g.target_at(target, q.t))) <= target.hit_radius_mm;
        }
        for (const SessionSample& sample : s.session.samples) {
            if (!sample.probe_ok) continue;
            const Point3 x =
                inverse(sample.mannequin_from_probe) * narrow(g.target_at(target, sample.time_s));
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
}

// Insertions as intervals of readings [entry, end), found by looking back and ahead.
struct Insertion {
    std::size_t entry, last;  // last: reading in the body, or the first out of it
    bool still_in;
};

std::vector<Insertion> insertions_of(const std::vector<R>& r) {
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
    return insertions;
}

void add_insertions(const Scene& s, const std::vector<R>& r, const Geometry& g, Scores& m) {
    const Exercise& e = s.exercise;
    const std::vector<Insertion> insertions = insertions_of(r);
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
            const V at = g.target_at(t, last.t);
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
}

// Five points of the face, pressed in by 2 mm; intervals of the probe's own readings.
void add_probe_time(const Scene& s, const Geometry& g, Scores& m) {
    const Exercise& e = s.exercise;
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
                g.inside(add(add(v(sample.mannequin_from_probe.translation), v(axes.column(0)), x),
                             v(axes.column(2)), z));
        }
        if (touches && before)
            m["probe_usage_time_s"] += Real(sample.time_s) - Real(before->time_s);
        before = &sample;
    }
}

}  // namespace

std::map<std::string, Real> slow_scores(const Scene& scene) {
    const Geometry geometry{scene};
    const std::vector<R> readings = readings_of(scene, geometry);
    Scores scores;
    add_guidance(readings, scores);
    add_contacts(readings, geometry, scores);
    add_targets(scene, readings, geometry, scores);
    add_insertions(scene, readings, geometry, scores);
    add_probe_time(scene, geometry, scores);
    return scores;
}

}  // namespace sonocase::testing
