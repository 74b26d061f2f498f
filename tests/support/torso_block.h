// SPDX-License-Identifier: Apache-2.0

// A block of the analytic torso cooked through its known warp, and the errors of its surfaces
// against the closed forms.
#pragma once

#include <algorithm>
#include <bitset>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "formats/volume/boundary_record.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/resample_labels.h"
#include "support/random.h"

namespace sonocase::pipeline::testing {

inline Grid grid_between(Point3 lower, Point3 upper, Vector3 spacing_mm) {
    Grid grid;
    grid.spacing_mm = spacing_mm;
    grid.origin_mm = lower;
    for (int a = 0; a < 3; ++a)
        grid.size[a] = static_cast<int>((upper[a] - lower[a]) / spacing_mm[a]) + 1;
    return grid;
}
// Contains entirely: liver, both kidneys, spleen, stomach, gall bladder, pancreas, and the four
// vessels of 1.5 to 5 mm radius in the liver.
inline Grid upper_abdomen(Vector3 spacing_mm) {
    return grid_between({-142, -75, -62}, {142, 91, 143}, spacing_mm);
}
// Contains entirely: liver with its vessels, gall bladder.
inline Grid round_the_liver(Vector3 spacing_mm) {
    return grid_between({-38, -75, -17}, {142, 91, 143}, spacing_mm);
}

class TorsoBlock {
  public:
    explicit TorsoBlock(const Grid& ct, const ResampleOptions& options = {})
        : ct_(sample_analytic_torso(ct)) {
        registration_.ct_box = ct_.grid.bounds();
        inverse_map_.emplace(with_voxel_rim(registration_, ct_.grid));
        result_ = std::move(*resample_labels({ct_, registration_}, options));
    }
    const ResampleResult& result() const { return result_; }
    const Registration& registration() const { return registration_; }
    const Grid& ct_grid() const { return ct_.grid; }

    // Palette index; -1 for an unknown name.
    int label(const std::string& name) const {
        for (std::size_t l = 0; l < ct_.labels.size(); ++l) {
            if (ct_.labels[l].name == name) return static_cast<int>(l);
        }
        return -1;
    }
    // Relative change of volume, 0.01 is one percent; NaN for an unknown name.
    double change(const std::string& name) const {
        for (const LabelChange& c : result_.changes) {
            if (c.name == name) return c.change();
        }
        return NAN;
    }

    // Preimage of a point; empty near the block's own faces, which are not anatomy.
    std::optional<Point3> inner_ct_point(Point3 mannequin) const {
        float x, y, z;
        MapStatus status;
        inverse_map_->invert_row(mannequin, {1, 0, 0}, 1, &x, &y, &z, &status);
        if (status != MapStatus::ok) return {};
        const Point3 ct{x, y, z};
        const Box3 box = ct_.grid.bounds();
        for (int a = 0; a < 3; ++a) {
            if (ct[a] <= box.lower[a] + 6 || ct[a] >= box.upper[a] - 6) return {};
        }
        return ct;
    }
    // Of the true surface of `label`, in `mannequin`, into the label: normals go with the inverse
    // transpose of the map.
    Vector3 true_normal(int label, Point3 ct) const {
        Vector3 slope;
        for (int a = 0; a < 3; ++a) {
            Vector3 step;
            step[a] = 0.01;
            slope[a] = analytic_torso_signed_distance(label, ct - step, 3) -
                       analytic_torso_signed_distance(label, ct + step, 3);
        }
        return normalized(transpose(inverse(jacobian(registration_, ct))) * slope);
    }

    struct PlaneError {
        double distance_mm;  // of the plane's foot from the true surface, in `ct`
        double normal_deg;
        int second_label;
        Point3 ct;
        // A third label lies within a record's reach of the foot: the surface has an edge there,
        // and beside an edge the nearest face may be another than the record's.
        bool at_edge;
    };
    // Of every `stride`-th record of a voxel of `label`, in the middle of the block.
    std::vector<PlaneError> plane_errors(int label, std::size_t stride = 1) const {
        std::vector<PlaneError> errors;
        std::vector<Vector3> normals;
        const Grid& g = result_.volume.grid;
        std::size_t met = 0;
        for (int k = 0; k < g.size.z; ++k) {
            for (int j = 0; j < g.size.y; ++j) {
                for (int i = 0; i < g.size.x; ++i) {
                    if (result_.volume.voxels[g.index(i, j, k)] != label) continue;
                    const std::uint32_t packed = result_.boundary.at(i, j, k);
                    if (packed == kNoBoundary || ++met % stride != 0) continue;
                    const BoundaryRecord record = unpack_boundary(packed);
                    const Point3 foot =
                        g.point_from_voxel({static_cast<double>(i), static_cast<double>(j),
                                            static_cast<double>(k)}) -
                        record.distance_vx * g.spacing_mm.x * record.normal;
                    const std::optional<Point3> ct = inner_ct_point(foot);
                    if (!ct) continue;
                    errors.push_back({0, 0, record.second_label, *ct, false});
                    normals.push_back(record.normal);
                }
            }
        }
        parallel_for(errors.size(), 16, [&](std::size_t begin, std::size_t end) {
            for (std::size_t n = begin; n < end; ++n) {
                PlaneError& e = errors[n];
                e.distance_mm = std::abs(analytic_torso_signed_distance(label, e.ct, 3));
                e.normal_deg = angle_deg(true_normal(label, e.ct), normals[n]);
                e.at_edge = labels_within(2, e.ct) > 2;
            }
        });
        return errors;
    }

    static double angle_deg(Vector3 a, Vector3 b) {
        return 57.29577951 * std::acos(std::clamp(dot(a, b), -1.0, 1.0));
    }

    // Share of `points` random points within `reach_mm` (in `ct`) of a true surface whose label is
    // right as a renderer reads it: of the voxel, or of either side of its plane if it has a
    // record. With reach_mm 0: of points in voxels that have a record.
    double right_class(int points, double reach_mm, std::uint64_t seed) const {
        const Grid& g = result_.volume.grid;
        sonocase::testing::Random random(seed);
        int right = 0, count = 0;
        while (count < points) {
            const Point3 v{random.uniform(0, g.size.x - 1.0), random.uniform(0, g.size.y - 1.0),
                           random.uniform(0, g.size.z - 1.0)};
            const int i = static_cast<int>(std::lround(v.x)),
                      j = static_cast<int>(std::lround(v.y)),
                      k = static_cast<int>(std::lround(v.z));
            const std::uint32_t packed = result_.boundary.at(i, j, k);
            if (reach_mm == 0 && packed == kNoBoundary) continue;
            const std::optional<Point3> ct = inner_ct_point(g.point_from_voxel(v));
            if (!ct) continue;
            const int truth = analytic_torso_label(*ct);
            if (reach_mm > 0 &&
                std::abs(analytic_torso_signed_distance(truth, *ct, reach_mm)) >= reach_mm)
                continue;
            int read = result_.volume.voxels[g.index(i, j, k)];
            if (packed != kNoBoundary) {
                const BoundaryRecord r = unpack_boundary(packed);
                const double d = r.distance_vx + dot(r.normal, Vector3{v.x - i, v.y - j, v.z - k});
                if (d < 0) read = r.second_label;
            }
            right += read == truth;
            ++count;
        }
        return static_cast<double>(right) / count;
    }

  private:
    // Labels at the corners, edges and faces of a cube about the point.
    static int labels_within(double half_edge_mm, Point3 ct) {
        std::bitset<256> present;
        for (int q = 0; q < 27; ++q) {
            const Vector3 step{q % 3 - 1.0, q / 3 % 3 - 1.0, q / 9 - 1.0};
            present.set(analytic_torso_label(ct + half_edge_mm * step));
        }
        return static_cast<int>(present.count());
    }

    LabelVolume ct_;
    Registration registration_ = analytic_torso_truth();
    std::optional<InverseMap> inverse_map_;
    ResampleResult result_;
};

inline double percentile(std::vector<double> values, double part) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

}  // namespace sonocase::pipeline::testing
