// SPDX-License-Identifier: Apache-2.0

// The search that find_streaks() runs: shared by streak_plates.cpp and portal_tracts.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include "runtime/imaging/physical/model/cell_hash.h"
#include "runtime/imaging/physical/model/lobule_walls.h"
#include "runtime/imaging/physical/model/streak_plates.h"

namespace sonocase::runtime::physical {

// Of a tract from the cell in which it begins: its half length and what lies beside it.
inline constexpr double kTractReachMm = 14;

// (1 - x)^4, close to a Gaussian, 0 from x = 1 on.
inline double bump(double x) {
    const double y = std::max(1 - x, 0.0);
    return y * y * y * y;
}

// Share of its echo below which a plate is left out, and a little more than the x of bump() there.
inline constexpr double kFaintest = 0.1, kFaintSquare = 0.438;

// A plate in the tissue, frame of the volume.
struct Plate {
    Point3 centre;
    Vector3 normal;          // not unit
    double length_mm = 4;    // along the fibres, if it has any
    std::uint32_t draw = 0;  // random bits
    Vector3 fibres;          // unit; zero: as long in every direction
};

struct StreakSearch {
    const PlateKind& kind;
    bool septa;
    const PhysicalScene& scene;
    const ScanGeometry& g;
    const Tables& tables;
    const PhysicalFrame& frame;
    const BreathingField* breathing;
    std::span<const float> gaps;
    std::span<Streak> out;
    Rigid probe_from_volume;
    double thickest_mm = 0;  // of the slab: deviation at the face or at the far end
    double pressed_mm = 0;   // tissue shows so much nearer to the face than it lies at rest
    double turned = 0;       // by pressing: sine of the most that the beam at a place turns
    int found = 0;

    // The label that holds plates there; negative: none.
    int plates_at(Point3 x) const {
        const Point3 v = scene.grid.voxel_from_point(x);
        const int label = label_at(scene, static_cast<int>(std::floor(v.x + 0.5)),
                                   static_cast<int>(std::floor(v.y + 0.5)),
                                   static_cast<int>(std::floor(v.z + 0.5)));
        const int cube = scene.fine.frames[static_cast<std::size_t>(label)].cube;
        const bool holds =
            septa ? is_muscle_cube(cube) || is_fat_cube(cube) : cube == kParenchymaCube;
        return holds ? label : -1;
    }

    // Where a point of the tissue shows, in the probe's frame, before anything is pressed.
    Point3 seen_at_rest(Point3 x) const {
        if (breathing != nullptr) x = x + breathing->weight(x) * frame.motion.breathing_mm;
        return probe_from_volume * x;
    }
    Point3 pressed(Point3 p) const {
        const PlanePoint q = press::shown_point(*frame.press, {p.x, p.z});
        return {q.x, p.y, q.z};
    }

    // The beam at a place: its direction, and how far the place lies along it.
    PlanePoint beam_at(PlanePoint p, double& r) const {
        if (!g.fan) {
            r = p.z;
            return {0, 1};
        }
        const double x = p.x, z = p.z + g.radius_mm;
        const double from_centre = std::max(std::sqrt(x * x + z * z), 1e-9);
        r = from_centre - g.radius_mm;
        return {x / from_centre, z / from_centre};
    }

    // A normal of a septum: about the skin's in fat, across the fibres in muscle.
    Vector3 lined_up(Vector3 any, Vector3 guide, bool fibres) const {
        if (fibres) return any - dot(any, guide) * guide;
        return guide + (kind.scatter / 64) * any;
    }

    // Sine of the angle to the beam at which a plate shows nothing.
    double widest_sin(bool fibrous) const { return fibrous ? kind.diffuse_sin : kind.face_sin; }
    // Share of its echo that a plate sends back, by the square of that sine.
    double facing(double sine2, bool fibrous) const {
        const double mirror = bump(sine2 / (kind.face_sin * kind.face_sin));
        if (!fibrous) return mirror;
        const double all_ways = 1 - sine2 / (kind.diffuse_sin * kind.diffuse_sin);
        return mirror + kind.diffuse * (1 - mirror) * std::max(all_ways, 0.0);
    }

    // Sine at which a plate is too faint to show, a little more; a plate at a distance of
    // `away` in radians from where the beam is known may have turned by so much.
    double faint_sin(bool fibrous, double away) const {
        double sine = std::sqrt(kFaintSquare) * kind.face_sin;
        if (fibrous && kind.diffuse > 0)
            sine = std::max(
                kind.face_sin,
                kind.diffuse_sin * std::sqrt(std::max(1 - 0.99 * kFaintest / kind.diffuse, 0.0)));
        return sine + away + turned;
    }

    // The row of a depth, the nearest one beyond them.
    const Row& row_at(double depth) const {
        const int k = static_cast<int>(std::clamp(depth / g.step_mm, 0.0, g.samples - 1.0));
        return tables.rows[static_cast<std::size_t>(k)];
    }

    void add_cell(int i, int j, int k);
    void add_lobule(Int3 cell, const LobuleView& view);
    void add_plate(const Plate& plate);
    // Tracts of the cell whose lowest corner this is (portal_tracts.cpp).
    void add_tracts(Point3 corner, std::uint32_t cell);
    // One straight piece. axis: unit, frame of the volume; draw: of its two walls.
    void add_tract_piece(Point3 centre,
                         Vector3 axis,
                         double length,
                         double radius,
                         double amplitude,
                         std::uint32_t draw);

    // A place of the plane as the picture shows it: the gap to the skin closes, so that it lies
    // that much closer to the face. False: in air, or out of the picture.
    struct Shown {
        PlanePoint at, beam;
        double depth = 0, line = 0;
    };
    bool show(PlanePoint p, Shown& shown) const {
        double r = 0, sample = 0;
        shown.beam = beam_at(p, r);
        g.locate(p, shown.line, sample);
        const int nearest = static_cast<int>(std::clamp(shown.line + 0.5, 0.0, g.scanlines - 1.0));
        const double gap = static_cast<double>(gaps[static_cast<std::size_t>(nearest)]);
        if (gap < 0) return false;
        shown.depth = r;
        for (int step = 0; step < 3; ++step) shown.depth = r - gap * row_at(shown.depth).contact;
        if (shown.depth < kind.first_mm || shown.depth > g.depth_mm) return false;
        shown.at = {p.x + (shown.depth - r) * shown.beam.x, p.z + (shown.depth - r) * shown.beam.z};
        return true;
    }
    // Where a plate with its place, direction, length and width shows; keeps it if anywhere. Beyond
    // 0.9 L from its middle a plate is 0.5 % of itself, beyond three widths 1 %.
    void keep(const Shown& shown, double sunk_mm, Streak& s) {
        const double reach = 0.9 * s.length_mm + 3 * s.width_mm;
        const double facing = s.normal.x * shown.beam.x + s.normal.z * shown.beam.z;
        const double slope = std::sqrt(std::max(1 - facing * facing, 0.0));
        const double deep = 0.9 * s.length_mm * slope + 3 * s.width_mm + g.step_mm + 3.3 * sunk_mm;
        const double pitch = g.fan ? (g.radius_mm + shown.depth) * g.line_step : g.line_step;
        s.line_begin = std::max(static_cast<int>(shown.line - reach / pitch), 0);
        s.line_end = std::min(static_cast<int>(shown.line + reach / pitch) + 2, g.scanlines);
        s.sample_begin = std::max(static_cast<int>((shown.depth - deep) / g.step_mm), 0);
        s.sample_end = std::min(static_cast<int>((shown.depth + deep) / g.step_mm) + 1, g.samples);
        if (s.line_begin < s.line_end && s.sample_begin < s.sample_end) ++found;
    }
};

}  // namespace sonocase::runtime::physical
