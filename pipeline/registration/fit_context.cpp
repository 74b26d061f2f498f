// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit_context.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline::inline registration {
namespace {

constexpr double kFineSkinMm = 6, kCoarseSkinMm = 13;
constexpr double kLatticeMm = 20;
constexpr double kShallowestMm = 20;  // below the skin: above are skin, fat and body wall

std::vector<Point3> points_inside(const SkinModel& skin, const Box3& box) {
    const PointIndex index(skin.points);
    std::vector<Point3> inside;
    const Vector3 e = box.extent();
    for (double z = 0.5 * kLatticeMm; z < e.z; z += kLatticeMm) {
        for (double y = 0.5 * kLatticeMm; y < e.y; y += kLatticeMm) {
            for (double x = 0.5 * kLatticeMm; x < e.x; x += kLatticeMm) {
                const Point3 p = box.lower + Vector3{x, y, z};
                const std::uint32_t n = index.nearest(p);
                const Vector3 d = p - skin.points[n];
                if (norm(d) > kShallowestMm && dot(d, skin.normals[n]) < 0) inside.push_back(p);
            }
        }
    }
    return inside;
}

// What the landmarks say about the open side: > 0 that it is the patient's back, < 0 the front.
// Each landmark counts that lies clearly in front of or behind the middle of both bodies.
double vote_of_landmarks(const FitContext& s) {
    Box3 skin, readings;
    for (Point3 p : s.fine.points) skin.include(p);
    for (std::uint32_t i : s.readings) readings.include(s.target.points[i]);
    const double half_depth = 0.5 * skin.extent().y;
    double lowest = INFINITY, highest = -INFINITY;
    for (std::uint32_t i : s.readings) {
        const double along = dot(s.open_side.direction, s.target.points[i] - Point3{});
        lowest = std::min(lowest, along);
        highest = std::max(highest, along);
    }
    double vote = 0;
    for (const PoseHints::Place& mark : s.hints.landmarks) {
        const double front = (mark.skin.y - skin.centre().y) / half_depth;
        const double towards_hole = dot(s.open_side.direction, mark.target - Point3{});
        // The readings end near the middle of the body, where the hole begins.
        const double from_hole = (highest - towards_hole) / std::max(1.0, highest - lowest);
        if (std::abs(front) > 0.4 && (from_hole > 0.6 || from_hole < 0.1))
            vote += front * (from_hole > 0.6 ? 1 : -1);
    }
    return vote;
}

void decide_open_side(const std::string& wanted, FitContext* s) {
    s->open_side = find_open_side(s->target, s->hints.up);
    const bool table = s->target.table.found;
    if (table) s->open_side = open_towards(-s->target.table.normal);
    s->open_side_is = "none";
    if (wanted == "none") {
        s->open_side_why = "the recipe wants no open side to be considered";
        return;
    }
    if (!s->open_side.open() && wanted == "auto") {
        s->open_side_why = s->open_side.weight_mm2() > 0 || s->open_side.size > 0.15
                               ? "the sweep is open towards a flank, which says nothing of the back"
                               : "the sweep is closed";
        return;
    }
    const double vote = vote_of_landmarks(*s);
    if (wanted != "auto") {
        s->open_side_is = wanted;
        s->open_side_why = "the recipe says so";
    } else if (vote < 0) {
        s->open_side_is = "front";
        s->open_side_why = "the landmarks say so";
    } else {
        s->open_side_is = "back";
        s->open_side_why = vote > 0 ? "the landmarks say so"
                           : table  ? "the patient lies on the table that was read (--open-side)"
                                    : "a patient on a table lies on it (--open-side)";
    }
    s->hints.back = s->open_side_is == "back" ? s->open_side.direction : -s->open_side.direction;
    s->hints.back_weight_mm2 = std::max(s->open_side.weight_mm2(), wanted == "auto" ? 0.0 : 300.0);
}

}  // namespace

Result<FitContext> prepare_fit(const RegisterInput& input, const RegisterOptions& options) {
    SONOCASE_TRY(TargetSurface target, prepare_target(input.mannequin, options.target));
    FitContext s{.skin = input.skin, .target = std::move(target), .labels = input.labels};
    const Point3 origin = input.skin.box.centre();
    s.fine = thin_skin(input.skin.skin, input.skin.on_rim, origin, kFineSkinMm);
    s.coarse = thin_skin(input.skin.skin, input.skin.on_rim, origin, kCoarseSkinMm);
    s.box.include(Point3{} + (input.skin.box.lower - origin));
    s.box.include(Point3{} + (input.skin.box.upper - origin));
    s.readings = thin_target(s.target, 0);
    s.motion = find_sweep_motion(s.target);
    if (options.up) {
        const double length = norm(*options.up);
        if (!(length > 1e-6) || !std::isfinite(length)) {
            return Error{"the up direction has no length", "--up",
                         "give the patient's head direction in the surface's frame, e.g. 0,1,0"};
        }
        s.hints.up = *options.up / length;
    }
    for (const Landmark& mark : options.landmarks) {
        if (!std::isfinite(norm(mark.ct - Point3{})) ||
            !std::isfinite(norm(mark.mannequin - Point3{}))) {
            return Error{"landmark '" + mark.name + "' is not finite", "--landmarks",
                         "rows are name,ct_x,ct_y,ct_z,x,y,z in mm"};
        }
        const Point3 a = Point3{} + (mark.ct - origin);
        const Point3 b = Point3{} + (mark.mannequin - s.target.origin);
        s.hints.landmarks.push_back({a, b});
        s.landmarks.push_back({a, b});
    }
    decide_open_side(options.open_side, &s);
    s.inside = points_inside(s.coarse, s.box);
    return s;
}

Registration in_frames(const FitContext& s, const RigidQuadratic& q) {
    Registration r;
    r.quadratic = in_frames(q, s.fine.origin, s.target.origin);
    r.ct_box = s.skin.box;
    r.mannequin_from_ct.rotation = q.rigid.rotation;
    r.mannequin_from_ct.translation = (s.target.origin - Point3{}) + q.rigid.translation -
                                      q.rigid.rotation * (s.fine.origin - Point3{});
    return r;
}

}  // namespace sonocase::pipeline::inline registration
