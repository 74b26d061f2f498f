// SPDX-License-Identifier: Apache-2.0

#include "formats/scoring/draw_attempt.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <optional>

#include "formats/base/random.h"
#include "formats/scoring/draw_lesion.h"

namespace sonocase {
namespace {

constexpr int kShift = 40;
constexpr int kDifficulties[] = {0, -1, -2, 1, 2};

struct Factors {
    double spread, start, size;
    const char* make;  // of a needle as exercises have it without a word; null: as it is
};
constexpr Factors kFactors[] = {{0.4, 0.6, 1, "notched"},
                                {0.7, 0.8, 1, nullptr},
                                {1, 1, 1, nullptr},
                                {1, 1.2, 0.85, nullptr},
                                {1, 1.4, 0.7, nullptr}};

}  // namespace

int attempt_difficulty(std::uint64_t seed) {
    const std::uint64_t code = seed >> kShift;
    return code < std::size(kDifficulties) ? kDifficulties[code] : 0;
}

std::uint64_t seed_with_difficulty(std::uint64_t seed, int difficulty) {
    assert(seed >> kShift == 0);
    if (seed == 0) return 0;
    const int wanted = std::clamp(difficulty, kEasiest, kHardest);
    const auto* found = std::find(std::begin(kDifficulties), std::end(kDifficulties), wanted);
    return seed | static_cast<std::uint64_t>(found - std::begin(kDifficulties)) << kShift;
}

void apply_difficulty(int difficulty, Exercise& exercise) {
    if (difficulty == 0) return;
    const Factors& by = kFactors[std::clamp(difficulty, kEasiest, kHardest) - kEasiest];
    for (Target& target : exercise.targets) {
        // The clearance that the author asked for does not shrink with the size.
        if (target.clearance_mm < 0) target.clearance_mm = outer_radius_mm(target);
        target.spread_mm *= by.spread;
        target.hit_radius_mm *= by.size;
        if (target.look != TargetLook::none) target.radius_mm *= by.size;
    }
    exercise.start_spread_mm *= by.start;
    if (by.make != nullptr && exercise.needle.make == &needle_makes().front())
        exercise.needle.make = find_needle_make(by.make);
}

namespace {

constexpr int kPlaces = 400;           // places tried for a target
constexpr int kStarts = 200;           // places tried for the probe
constexpr int kDirections = 96;        // directions tried for lines to a target
constexpr double kSpareLengthMm = 10;  // length of the needle left for the hand
constexpr double kOffPlaneMm = 20;     // distance of the targets from the scan plane at the start
constexpr double kOpenMm = 40;         // depth to which the picture at the start is not in shadow
constexpr double kLineGapMm = 6;       // between lines that are tried for it
constexpr double kApartMm = 2;         // gap between a finding and other findings or targets
constexpr std::uint64_t kLesionStream = 0x6A09E667F3BCC909ull;  // fractional part of the root of 2
constexpr std::uint64_t kFluidStream = 0xBB67AE8584CAA73Bull;   // of the root of 3
constexpr double kMinCosine = 0.17364817766693041;              // of 80 degrees
constexpr double kMaxCosine = 0.93969262078590843;              // of 20 degrees

struct Body {
    const Anatomy& anatomy;
    std::array<bool, 256> no_go{};

    Body(const Exercise& exercise, const Anatomy& body, const std::vector<Label>& labels)
        : anatomy(body) {
        for (std::size_t i = 0; i < labels.size() && i < no_go.size(); ++i) {
            no_go[i] = std::find(exercise.no_go.begin(), exercise.no_go.end(), labels[i].name) !=
                       exercise.no_go.end();
        }
    }

    // The distance from p to the skin along a direction; empty if that is more than reach_mm, or if
    // the body is cut off there.
    std::optional<double> to_skin(Point3 p, Vector3 direction, double reach_mm) const {
        const double depth = anatomy.exit_distance(p, direction, reach_mm);
        if (!(depth < reach_mm) || anatomy.at_edge(p + depth * direction)) return {};
        return depth;
    }
    // True if sound passes along the line and, for a needle, no structure on it must be spared.
    bool free(Point3 p, Vector3 direction, double length_mm, bool needle) const {
        for (double s = 0; s < length_mm; s += 1) {
            const int label = anatomy.label(p + s * direction);
            if (anatomy.blocks_sound(label)) return false;
            if (needle && no_go[label]) return false;
        }
        return true;
    }
};

// True if a ball about p lies in a label. Tested at its centre, and half-way to and at its surface
// in 26 directions: those from a cube's centre to its faces, edges and corners.
bool clear_of_others(const Anatomy& anatomy, Point3 p, int label, double clearance_mm) {
    if (anatomy.label(p) != label) return false;
    for (const double part : {0.5, 1.0}) {
        for (int i = 0; i < 27; ++i) {
            const int column = i % 3 - 1, row = i / 3 % 3 - 1, layer = i / 9 - 1;
            const Vector3 v{double(column), double(row), double(layer)};
            if (i == 13) continue;
            const double length = std::sqrt(dot(v, v));
            if (anatomy.label(p + (part * clearance_mm / length) * v) != label) return false;
        }
    }
    return true;
}

// True if a needle reaches p while a probe shows it.
bool reachable(const Exercise& exercise, const Body& body, Point3 p, RandomStream draws) {
    const double reach = exercise.needle.length_mm - kSpareLengthMm;
    const double depth = exercise.probe.depth_mm - exercise.targets.front().radius_mm;
    std::vector<Vector3> shown;
    std::vector<Vector3> needles;
    for (int i = 0; i < kDirections; ++i) {
        const Vector3 out = draws.direction();
        const auto way = body.to_skin(p, out, std::max(reach, depth));
        if (!way || !body.free(p, out, *way, false)) continue;
        if (*way <= depth) shown.push_back(out);
        if (*way <= reach && body.free(p, out, *way, true)) needles.push_back(out);
    }
    for (const Vector3 needle : needles) {
        for (const Vector3 beam : shown) {
            const double cosine = dot(needle, beam);
            if (cosine >= kMinCosine && cosine <= kMaxCosine) return true;
        }
    }
    return false;
}

int label_of(const std::vector<Label>& labels, const std::string& name) {
    for (std::size_t i = 0; i < labels.size(); ++i) {
        if (labels[i].name == name) return static_cast<int>(i);
    }
    return -1;
}

double clearance_of(const Target& lesion) {
    return lesion.clearance_mm < 0 ? outer_radius_mm(lesion) : lesion.clearance_mm;
}

// A place for a finding, clear of targets and of the findings before it.
std::optional<Point3> draw_finding(const Exercise& exercise,
                                   std::size_t f,
                                   const Anatomy& anatomy,
                                   const std::vector<Label>& labels,
                                   RandomStream& draws) {
    const Target& lesion = exercise.findings[f].lesion;
    const int label =
        lesion.inside.empty() ? anatomy.label(lesion.centre) : label_of(labels, lesion.inside);
    if (label < 0) return {};
    const double reach = outer_radius_mm(lesion);
    const auto apart = [&](const Target& other, Point3 p) {
        return distance(other.centre, p) >= outer_radius_mm(other) + reach + kApartMm;
    };
    for (int i = 0; i < kPlaces; ++i) {
        const Point3 p = lesion.centre + lesion.spread_mm * draws.in_ball();
        bool room = clear_of_others(anatomy, p, label, clearance_of(lesion));
        for (const Target& target : exercise.targets) room = room && apart(target, p);
        for (std::size_t before = 0; before < f; ++before)
            room = room && apart(exercise.findings[before].lesion, p);
        if (room) return p;
    }
    return {};
}

std::optional<Point3> draw_target(const Exercise& exercise,
                                  std::size_t t,
                                  const Body& body,
                                  const std::vector<Label>& labels,
                                  RandomStream& draws) {
    const Target& target = exercise.targets[t];
    const int label =
        target.inside.empty() ? body.anatomy.label(target.centre) : label_of(labels, target.inside);
    if (label < 0) return {};
    const double clearance = clearance_of(target);
    for (int i = 0; i < kPlaces; ++i) {
        const Point3 p = target.centre + target.spread_mm * draws.in_ball();
        if (!clear_of_others(body.anatomy, p, label, clearance)) continue;
        bool overlaps = false;
        for (std::size_t other = 0; other < exercise.targets.size(); ++other) {
            const Target& o = exercise.targets[other];
            overlaps =
                overlaps || (other != t && distance(o.centre, p) < o.radius_mm + target.radius_mm);
        }
        if (!overlaps && reachable(exercise, body, p, draws)) return p;
    }
    return {};
}

// Outward normal of the skin near p, found as for the mouse: the mean outward direction in a ball.
Vector3 skin_normal(const Anatomy& anatomy, Point3 p) {
    constexpr int kSteps = 4;
    constexpr double kRadiusMm = 12;
    Vector3 sum;
    for (int k = -kSteps; k <= kSteps; ++k) {
        for (int j = -kSteps; j <= kSteps; ++j) {
            for (int i = -kSteps; i <= kSteps; ++i) {
                const Vector3 v{double(i) / kSteps, double(j) / kSteps, double(k) / kSteps};
                if (dot(v, v) > 1) continue;
                if (anatomy.inside(p + kRadiusMm * v)) sum = sum - (1 - dot(v, v)) * v;
            }
        }
    }
    return normalized(sum);
}

// The point at which the line through p along the beam enters the skin.
std::optional<Point3> skin_on_line(const Anatomy& anatomy, Point3 p, Vector3 beam) {
    constexpr double kReachMm = 80;
    bool outside = false;
    for (double s = -kReachMm; s <= kReachMm; s += 0.5) {
        const Point3 q = p + s * beam;
        if (!anatomy.inside(q)) {
            outside = true;
        } else if (outside) {
            return q;
        }
    }
    return {};
}

// Whether sound gets kOpenMm deep along most of five lines that start side by side on a probe's
// face: a picture that a rib or the lung blackens teaches nothing to begin with.
bool sees_in(const Anatomy& anatomy, Point3 skin, Vector3 inwards, Vector3 lateral) {
    int blocked = 0;
    for (int i = -2; i <= 2; ++i) {
        const Point3 from = skin + i * kLineGapMm * lateral;
        bool open = true;
        for (double s = 0; s < kOpenMm && open; s += 1)
            open = !anatomy.blocks_sound(anatomy.label(from + s * inwards));
        blocked += !open;
    }
    return blocked <= 2;
}

bool draw_start(Exercise& exercise, const Anatomy& anatomy, RandomStream& draws) {
    const Matrix3 start = start_pose(exercise).rotation;
    const Vector3 beam = start.column(2), lateral = start.column(0);
    const Vector3 u = any_perpendicular(beam), v = cross(beam, u);
    double best_mm = -1;
    bool best_open = false;
    Point3 best;
    for (int i = 0; i < kStarts; ++i) {
        const double a = draws.uniform(-1, 1), b = draws.uniform(-1, 1);
        const double r2 = a * a + b * b;
        if (r2 > 1 || r2 < 0.25) continue;
        const Point3 near = exercise.start_probe + exercise.start_spread_mm * (a * u + b * v);
        const auto skin = skin_on_line(anatomy, near, beam);
        if (!skin || anatomy.at_edge(*skin)) continue;
        const Vector3 normal = skin_normal(anatomy, *skin);
        // On a flank, which faces sideways, the probe would be turned away.
        if (!(dot(normal, beam) < -0.5)) continue;
        const Vector3 along_face = lateral - dot(lateral, normal) * normal;
        const Vector3 elevation = normalized(cross(-normal, along_face));
        double off_plane_mm = kOffPlaneMm;
        for (const Target& target : exercise.targets) {
            off_plane_mm = std::min(off_plane_mm, std::abs(dot(target.centre - *skin, elevation)));
        }
        const bool open = sees_in(anatomy, *skin, -normal, normalized(along_face));
        if (open < best_open || (open == best_open && off_plane_mm <= best_mm)) continue;
        best_mm = off_plane_mm;
        best_open = open;
        best = *skin;
        if (open && off_plane_mm >= kOffPlaneMm) break;
    }
    if (best_mm < 0) return false;
    exercise.start_probe = best;
    exercise.start_beam = beam;
    return true;
}

// Places the findings, and removes those for which there is no room.
void place_findings(AttemptDraw& out,
                    const Anatomy& anatomy,
                    const std::vector<Label>& labels,
                    RandomStream& draws) {
    std::vector<Finding>& findings = out.exercise.findings;
    for (std::size_t f = 0; f < findings.size();) {
        if (const auto place = draw_finding(out.exercise, f, anatomy, labels, draws)) {
            findings[f++].lesion.centre = *place;
            continue;
        }
        out.warnings.push_back(
            {"No place was found for the finding '{}', so this attempt lacks it: check its inside, "
             "spread_mm, "
             "radius_mm and clearance_mm.",
             {findings[f].lesion.name}});
        findings.erase(findings.begin() + static_cast<std::ptrdiff_t>(f));
    }
}

}  // namespace

AttemptDraw draw_attempt(const Exercise& exercise,
                         const Anatomy& anatomy,
                         const std::vector<Label>& labels,
                         std::uint64_t seed) {
    AttemptDraw out{exercise, {}};
    if (seed == 0) return out;
    apply_difficulty(attempt_difficulty(seed), out.exercise);
    RandomStream draws(seed);
    const Body body(exercise, anatomy, labels);
    // Lesions have a stream of their own, so that they do not change how targets are drawn.
    RandomStream lesion_draws(seed ^ kLesionStream);
    draw_shapes(out.exercise, lesion_draws);
    for (std::size_t t = 0; t < exercise.targets.size(); ++t) {
        if (!(out.exercise.targets[t].spread_mm > 0)) continue;
        if (const auto place = draw_target(out.exercise, t, body, labels, draws)) {
            out.exercise.targets[t].centre = *place;
        } else {
            out.warnings.push_back(
                {"No place was found for the target '{}', so it stays where the exercise has it: "
                 "check its "
                 "inside, spread_mm and clearance_mm.",
                 {exercise.targets[t].name}});
        }
    }
    place_findings(out, anatomy, labels, lesion_draws);
    RandomStream fluid_draws(seed ^ kFluidStream);
    std::vector<FreeFluid> fluids;
    for (FreeFluid fluid : out.exercise.free_fluids) {
        fluid.ml *= 1 + fluid.ml_spread * fluid_draws.uniform(-1, 1);
        if (fluid.chance >= 1 || fluid_draws.uniform(0, 1) < fluid.chance)
            fluids.push_back(std::move(fluid));
    }
    out.exercise.free_fluids = std::move(fluids);
    if (out.exercise.start_spread_mm > 0 && !draw_start(out.exercise, anatomy, draws)) {
        out.warnings.push_back(
            "No place away from the target was found for the probe, so it "
            "begins at start_probe: raise start_spread_mm.");
    }
    return out;
}

}  // namespace sonocase
