// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/frame_draw.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase::runtime::inline player_headless {
namespace {

constexpr int kTries = 40;
constexpr double kReachMm = 60;

// Where a probe may stand before it is slid, turned and pressed.
struct Stand {
    Point3 point;
    Vector3 beam, lateral;
    bool found = false;
};

Stand on_sweep(const Exercise& exercise, Draw& draw) {
    if (exercise.sweeps.empty())
        return {exercise.start_probe, exercise.start_beam, exercise.start_lateral, true};
    const Sweep& sweep = exercise.sweeps[draw.below(exercise.sweeps.size())];
    const SweepKey& a = sweep.keys[draw.below(sweep.keys.size())];
    const std::size_t i = &a - sweep.keys.data();
    const SweepKey& b = sweep.keys[std::min(i + 1, sweep.keys.size() - 1)];
    const double part = draw.uniform(0, 1);
    return {a.probe + part * (b.probe - a.probe), a.beam + part * (b.beam - a.beam),
            a.lateral + part * (b.lateral - a.lateral), true};
}

Stand on_surface(const CaseBundle& bundle, const SkinAreas& areas, const Skin& skin, Draw& draw) {
    const Surface& surface = bundle.patient_skin;
    if (areas.sums.empty() || !(areas.sums.back() > 0)) return {};
    const double at = draw.uniform(0, areas.sums.back());
    const std::size_t n = std::min<std::size_t>(
        static_cast<std::size_t>(std::upper_bound(areas.sums.begin(), areas.sums.end(), at) -
                                 areas.sums.begin()),
        areas.sums.size() - 1);
    const auto& t = surface.triangles[n];
    double u = draw.uniform(0, 1), v = draw.uniform(0, 1);
    if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
    }
    const Point3 a = surface.points[t[0]];
    const Point3 p = a + u * (surface.points[t[1]] - a) + v * (surface.points[t[2]] - a);
    const Vector3 normal = skin.normal(p);
    if (!(norm(normal) > 0) || skin.at_border(p)) return {};
    // The lateral axis lies across the body: along x as far as it can.
    return {p, -normal, {1, 0, 0}, true};
}

Rigid turned(Point3 origin, Vector3 beam, Vector3 lateral, const DatasetRecipe& r, Draw& draw) {
    const auto slope = [&](double degrees) {
        const double angle = draw.uniform(-degrees, degrees) * kRadPerDeg;
        return plain_sine(angle) / plain_cosine(angle);
    };
    Vector3 z = normalized(beam);
    Vector3 x = lateral - dot(lateral, z) * z;
    x = norm(x) > 1e-6 ? normalized(x) : any_perpendicular(z);
    const Vector3 y = cross(z, x);
    const double tilt = slope(r.tilt_deg), rock = slope(r.rock_deg);
    const double turn = draw.uniform(-r.rotate_deg, r.rotate_deg) * kRadPerDeg;
    z = normalized(z + tilt * y + rock * x);
    x = normalized(x - dot(x, z) * z);
    const Vector3 across = cross(z, x);
    const Vector3 turned_x = plain_cosine(turn) * x + plain_sine(turn) * across;
    return {Matrix3::from_columns(turned_x, cross(z, turned_x), z), origin - Point3{}};
}

void place_needle(const DatasetRecipe& r, const Exercise& exercise, Draw& draw, FrameInput& input) {
    input.has_needle = draw.uniform(0, 1) < r.needle_share;
    const double angle = draw.in(r.needle_angle_deg) * kRadPerDeg;
    const double side = draw.uniform(0, 1) < 0.5 ? -1 : 1;
    const double most_mm = std::min(r.tip_depth_mm.high, exercise.probe.depth_mm);
    const double depth = draw.uniform(std::min(r.tip_depth_mm.low, most_mm), most_mm);
    const Point3 tip{draw.uniform(-0.25, 0.25) * (exercise.probe.width_mm + depth),
                     draw.uniform(-r.off_plane_mm, r.off_plane_mm), depth};
    const Vector3 axis{side * plain_sine(angle), draw.uniform(-0.03, 0.03), plain_cosine(angle)};
    if (!input.has_needle) return;
    input.needle.tip = input.mannequin_from_probe * tip;
    input.needle.direction = normalized(input.mannequin_from_probe.rotation * axis);
    // The bevel faces the probe, as far as it can.
    const Vector3 d = input.needle.direction;
    const Vector3 up = -1 * input.mannequin_from_probe.rotation.column(2);
    const Vector3 across = up - dot(up, d) * d;
    input.needle.bevel = norm(across) > 1e-6 ? normalized(across) : any_perpendicular(d);
}

}  // namespace

Draw::Draw(std::uint64_t seed, std::uint64_t purpose, std::uint64_t place)
    : RandomStream(mix64(mix64(mix64(seed + kGoldenGamma) + purpose) + place)) {}

double plain_sine(double x) {
    // Taylor's series to x^21: the first term left out is 1e-11 at pi.
    double term = x, sum = x;
    for (int n = 1; n <= 10; ++n) {
        term *= -x * x / ((2 * n) * (2 * n + 1));
        sum += term;
    }
    return sum;
}

double plain_cosine(double x) {
    double term = 1, sum = 1;
    for (int n = 1; n <= 11; ++n) {
        term *= -x * x / ((2 * n - 1) * (2 * n));
        sum += term;
    }
    return sum;
}

SkinAreas::SkinAreas(const Surface& skin) {
    double sum = 0;
    for (const auto& t : skin.triangles) {
        const Point3 a = skin.points[t[0]];
        sum += 0.5 * norm(cross(skin.points[t[1]] - a, skin.points[t[2]] - a));
        sums.push_back(sum);
    }
}

DrawnFrame draw_frame(const DatasetRecipe& r,
                      const CaseBundle& bundle,
                      const SkinAreas& areas,
                      const Exercise& exercise,
                      std::uint64_t seed,
                      std::uint64_t frame) {
    Draw draw(seed, 1, frame);
    const Skin skin(bundle);
    DrawnFrame drawn;
    Rigid pose = turned(exercise.start_probe, exercise.start_beam, exercise.start_lateral, r, draw);
    for (int n = 0; n < kTries && !drawn.on_skin; ++n) {
        const Stand stand =
            r.region == "skin" ? on_surface(bundle, areas, skin, draw) : on_sweep(exercise, draw);
        if (!stand.found) continue;
        const Vector3 z = normalized(stand.beam);
        const Vector3 x = any_perpendicular(z), y = cross(z, x);
        const Point3 slid = stand.point + draw.uniform(-r.slide_mm, r.slide_mm) * x +
                            draw.uniform(-r.slide_mm, r.slide_mm) * y;
        const auto touched = skin.project(slid, z, kReachMm);
        if (!touched || skin.at_border(*touched)) continue;
        drawn.on_skin = true;
        pose = turned(*touched, z, stand.lateral, r, draw);
    }
    const Vector3 beam = pose.rotation.column(2);
    pose.translation = pose.translation + draw.in(r.pressed_mm) * beam;
    FrameInput& input = drawn.input;
    input.mannequin_from_probe = pose;
    input.time_s = draw.in(r.time_s);
    input.frame = static_cast<std::uint32_t>(draw.bits());
    input.settings.gain_db = draw.in(r.gain_db);
    place_needle(r, exercise, draw, input);
    return drawn;
}

}  // namespace sonocase::runtime::inline player_headless
