// SPDX-License-Identifier: Apache-2.0

// Closest-point matching of the mapped skin f(x) with the mannequin, in both directions: for each
// reading the closest skin point, and for each skin point the closest place on the mannequin.
//
// Both give rows of one form, n . (f(x) - y): x a skin point, y a place on the mannequin, n the
// mean of the two surfaces' normals. Points beyond a rim have no counterpart and give no row.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/volume/surface.h"
#include "pipeline/registration/fit/point_index.h"
#include "pipeline/registration/fit/target_surface.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_fit {

// Skin points as the fit uses them: ct frame, relative to `origin`.
struct SkinModel {
    Point3 origin;
    std::vector<Point3> points;
    std::vector<Vector3> normals;
    std::vector<std::uint8_t> on_rim;
};

// One point per cube of about spacing_mm, and every rim point; 0 takes all points.
SkinModel thin_skin(const Surface& skin,
                    std::span<const std::uint8_t> on_rim,
                    Point3 origin,
                    double spacing_mm);
// Indices of one target point per cube of about spacing_mm, without lift-offs; 0 takes all.
std::vector<std::uint32_t> thin_target(const TargetSurface& target, double spacing_mm);

struct Match {
    std::uint32_t skin = 0;
    Point3 place;       // on the mannequin, relative to the target's origin
    Vector3 normal;     // unit
    double gap_mm = 0;  // normal . (f(x) - place)
};

struct MatchOptions {
    double farthest_mm = 60;  // points farther apart are not matched
    double min_cosine = 0.3;  // of the angle between the two normals
    // Skin to mannequin: how far beside the nearest reading its plane is used.
    double side_step_mm = 12;
};

struct Matches {
    std::vector<Match> from_target;                    // for each reading, the closest skin point
    std::vector<Match> from_skin;                      // for each skin point, the closest reading
    std::size_t target_queries = 0, skin_queries = 0;  // tried
};

// mapped, mapped_normals  the mapped skin, mannequin frame relative to target.origin; # skin.points
// readings                indices of the target points to match
// skin_stride             every skin_stride-th skin point is matched
Matches find_matches(const SkinModel& skin,
                     std::span<const Point3> mapped,
                     std::span<const Vector3> mapped_normals,
                     const PointIndex& mapped_index,
                     const TargetSurface& target,
                     std::span<const std::uint32_t> readings,
                     std::size_t skin_stride,
                     const MatchOptions& options);

// The skin of a fit carried through a map, as closest-point matching wants it.

struct MappedSkin {
    std::vector<Point3> points;  // mannequin frame, relative to the target's origin; # skin.points
    std::vector<Vector3> normals;  // unit, outward where det J > 0
    PointIndex index;              // over the points
};

// y(x), and the inverse transpose of J times the skin's normal. Same bytes for any number of
// threads. Cost: 0.3 us per point.
MappedSkin map_skin(const SkinModel& skin, Point3 target_origin, const Registration& registration);

}  // namespace sonocase::pipeline::inline registration_fit
