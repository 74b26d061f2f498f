// SPDX-License-Identifier: Apache-2.0

// Which point of the skin lies against which place of the mannequin, and which have no counterpart.
//
// Both directions (a reading looks for the skin, the skin looks for the mannequin) give rows of one
// kind, n . (f(x) - y): x a skin point, y a place on the mannequin, n the mean of the mapped skin's
// normal and the mannequin's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/volume/surface.h"
#include "pipeline/registration/matching/point_index.h"
#include "pipeline/registration/matching/target_surface.h"

namespace sonocase::pipeline {

// Skin points as the fit uses them: ct frame less `origin`.
struct SkinModel {
    Point3 origin;
    std::vector<Point3> points;
    std::vector<Vector3> normals;
    std::vector<std::uint8_t> on_rim;
};

// One point per cube of about spacing_mm; 0 takes them all. Rim points stay rim points.
SkinModel thin_skin(const Surface& skin,
                    std::span<const std::uint8_t> on_rim,
                    Point3 origin,
                    double spacing_mm);
// Numbers of one target point per cube of about spacing_mm, lift-offs left out.
std::vector<std::uint32_t> thin_target(const TargetSurface& target, double spacing_mm);

struct Match {
    std::uint32_t skin = 0;
    Point3 place;       // on the mannequin, less the target's origin
    Vector3 normal;     // unit
    double gap_mm = 0;  // normal . (f(x) - place)
};

struct MatchOptions {
    double farthest_mm = 60;    // larger distances have no counterpart
    double least_cosine = 0.3;  // of the angle between the two normals
    double side_step_mm =
        12;  // skin to mannequin: how far beside the nearest reading its plane holds
};

struct Matches {
    std::vector<Match> from_target;  // a reading looked for the skin
    std::vector<Match> from_skin;    // the skin looked for the mannequin
    std::size_t target_asked = 0, skin_asked = 0;
};

// mapped, mapped_normals  the skin through the map, mannequin less target.origin; # skin.points
// readings                numbers of the target points that ask
// skin_stride             every so many-th skin point asks
Matches find_matches(const SkinModel& skin,
                     std::span<const Point3> mapped,
                     std::span<const Vector3> mapped_normals,
                     const PointIndex& mapped_index,
                     const TargetSurface& target,
                     std::span<const std::uint32_t> readings,
                     std::size_t skin_stride,
                     const MatchOptions& options);

}  // namespace sonocase::pipeline
