// SPDX-License-Identifier: Apache-2.0

// The gaps between the mapped skin and the mannequin, as rows of the elastic fit.
//
// Beyond the last readings the mannequin is continued by a quadratic height over the plane of each
// reading at the rim of a sweep, fitted to its neighbours. Without it the skin beside the rim would
// follow its own shape and not that of the mannequin.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/registration/elastic/spline_lattice.h"
#include "pipeline/registration/fit/matching.h"
#include "pipeline/registration/fit/quadratic_warp.h"
#include "pipeline/registration/fit/target_surface.h"
#include "pipeline/registration/map/registration.h"

namespace sonocase::pipeline::inline registration_elastic {

class RimPatches {
  public:
    static constexpr double kReachMm = 30;  // beside the reading

    // One patch for each of `readings` that is at the rim and not a lift-off. Cost: 5 us each.
    RimPatches(const TargetSurface& target, std::span<const std::uint32_t> readings);

    struct NearestPoint {
        bool found = false;
        double gap_mm = 0;  // signed distance of the point from the patch, first order
        Vector3 normal;     // of the patch there
    };
    // The point on the patch of `reading` below or above p; mannequin frame, relative to the
    // target's origin.
    NearestPoint nearest_point(std::uint32_t reading, Point3 p) const;

  private:
    struct Patch {
        Vector3 u, v;      // in the plane; its normal is that of the reading
        double c[6] = {};  // height = c0 + c1 a + c2 b + c3 aa + c4 ab + c5 bb
        bool good = false;
    };
    const TargetSurface& target_;
    std::vector<std::int32_t> patch_of_;  // # target points; -1: none
    std::vector<Patch> patches_;
};

// The gaps between the mapped skin and the mannequin, and the landmarks, as rows on a displacement.

struct GapOptions {
    double farthest_mm = 30;   // points farther apart are not matched
    double loss_mm = 2.5;      // Cauchy scale
    double rim_weight = 0.3;   // of skin beyond the last readings to the surface extrapolated there
    double skin_weight = 0.1;  // of skin to reading; reading to skin has 1
    double table_weight = 1;   // of skin behind the table, if the sweep has one
    std::size_t skin_stride = 1;  // every n-th skin point is matched
};

// Rows weight * loss^2 log(1 + gap^2 / loss^2) with gap = gap_mm + normal . (d - d_now), and
// weight |offset + d - d_now|^2 for landmarks. Skin that lies behind the table has a row to its
// plane, with a loss of 10 mm; skin before it has none.
class ElasticRows {
  public:
    // skin      as the fit uses it; a point within 8 mm of an open edge has no counterpart
    // readings  of the target
    ElasticRows(const SkinModel& skin,
                const TargetSurface& target,
                std::vector<std::uint32_t> readings,
                std::span<const Correspondence> landmarks,
                double landmark_weight,
                const DisplacementGrid& grid);

    // Matches anew. Reading to skin: the nearest mapped skin point, along its mapped normal; skin
    // to reading: the nearest reading, along its normal, or its patch beyond the rim.
    void match(const Registration& map, const GapOptions& options);

    double energy(double step) const;  // after `step` times the displacement given to project()
    void project(std::span<const Lanes> along);
    // Half of the gradient, and the diagonal of the half Hessian, added to.
    void add_gradient(std::span<Lanes> gradient, std::span<Lanes> diagonal) const;
    // out += half Hessian times in.
    void add_curvature(std::span<const Lanes> in, std::span<Lanes> out) const;

    std::size_t from_readings() const { return from_readings_; }
    std::size_t from_skin() const { return rows_.size() - from_readings_; }

  private:
    struct Row {
        SplineFootprint at;
        Vector3 normal;
        double gap_mm, weight, loss_mm2;
        double along_mm = 0;  // normal . of what project() was given
        Lanes scaled = {};    // normal times the root of the row's curvature
    };
    struct Mark {
        SplineFootprint at;
        Vector3 offset;  // from its place
        Vector3 along;
    };
    void add_row(std::uint32_t skin, Vector3 normal, double gap_mm, double weight, double loss_mm);
    void add_table_rows(const MappedSkin& mapped,
                        const GapOptions& options,
                        const std::vector<std::uint8_t>& matched);

    const SkinModel& skin_;
    const TargetSurface& target_;
    std::vector<std::uint32_t> readings_;
    std::vector<Correspondence> landmarks_;
    double landmark_weight_;
    DisplacementGrid grid_;  // without control points
    std::array<std::size_t, 64> offset_;
    std::vector<std::uint8_t> near_edge_;  // # skin points
    RimPatches rim_;
    std::vector<Row> rows_;
    std::vector<Mark> marks_;
    std::size_t from_readings_ = 0;
    mutable std::vector<std::vector<Lanes>> sums_;  // of each block of rows
};

}  // namespace sonocase::pipeline::inline registration_elastic
