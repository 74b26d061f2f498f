// A block of the analytic torso round its liver, cooked through its known warp, and how true its
// surfaces are against the closed forms.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "formats/boundary_record.h"
#include "pipeline/import/analytic_torso.h"
#include "pipeline/parallel.h"
#include "pipeline/registration/inverse_map.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/resample_labels.h"
#include "support/random.h"

namespace sonocase::pipeline::testing {

// Liver, gall bladder, kidney, colon and four vessels of 1.5 to 5 mm radius.
inline LabelVolume sample_torso_block(Vector3 spacing_mm) {
    Grid grid;
    const Point3 lower{0, -45, 5}, upper{125, 75, 125};
    grid.spacing_mm = spacing_mm;
    grid.origin_mm = lower;
    for (int a = 0; a < 3; ++a)
        grid.size[a] = static_cast<int>((upper[a] - lower[a]) / spacing_mm[a]) + 1;
    return sample_analytic_torso(grid);
}

class TorsoBlock {
  public:
    explicit TorsoBlock(Vector3 spacing_mm, const ResampleOptions& options = {})
        : ct_(sample_torso_block(spacing_mm)) {
        registration_.ct_box = ct_.grid.bounds();
        result_ = std::move(*resample_labels({ct_, registration_}, options));
    }
    const ResampleResult& result() const { return result_; }

    // Palette index; -1 for an unknown name.
    int label(const std::string& name) const {
        for (std::size_t l = 0; l < ct_.labels.size(); ++l) {
            if (ct_.labels[l].name == name) return static_cast<int>(l);
        }
        return -1;
    }
    // Change of volume, 0.01 is a percent; NaN for an unknown name.
    double change(const std::string& name) const {
        for (const LabelChange& c : result_.changes) {
            if (c.name == name) return c.change();
        }
        return NAN;
    }

    struct PlaneError {
        double distance_mm;  // of the plane's foot from the true surface, in `ct`
        double normal_deg;
        int second_label;
        Point3 ct;
    };
    // Of every `stride`-th record that a voxel of `label` holds, in the middle of the block.
    std::vector<PlaneError> plane_errors(int label, std::size_t stride = 1) const {
        std::vector<PlaneError> errors;
        std::vector<Vector3> normals;
        const Grid& g = result_.volume.grid;
        const InverseMap inverse_map(with_voxel_rim(registration_, ct_.grid));
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
                    const std::optional<Point3> ct = inner_ct_point(inverse_map, foot);
                    if (!ct) continue;
                    errors.push_back({0, 0, record.second_label, *ct});
                    normals.push_back(record.normal);
                }
            }
        }
        parallel_for(errors.size(), 16, [&](std::size_t begin, std::size_t end) {
            const auto distance = [&](Point3 p) {
                return analytic_torso_signed_distance(label, p, 3);
            };
            for (std::size_t n = begin; n < end; ++n) {
                const Point3 ct = errors[n].ct;
                errors[n].distance_mm = std::abs(distance(ct));
                // Into the label, through the map: normals go with the inverse transpose.
                Vector3 slope;
                for (int a = 0; a < 3; ++a) {
                    Vector3 step;
                    step[a] = 0.01;
                    slope[a] = distance(ct - step) - distance(ct + step);
                }
                const Vector3 truth =
                    normalized(transpose(inverse(jacobian(registration_, ct))) * slope);
                errors[n].normal_deg =
                    57.29577951 * std::acos(std::clamp(dot(truth, normals[n]), -1.0, 1.0));
            }
        });
        return errors;
    }

    // Share of random points in voxels with a record that its plane puts on the right side.
    double right_class(int points, std::uint64_t seed) const {
        const Grid& g = result_.volume.grid;
        const InverseMap inverse_map(with_voxel_rim(registration_, ct_.grid));
        sonocase::testing::Random random(seed);
        int right = 0, count = 0;
        while (count < points) {
            const Point3 v{random.uniform(0, g.size.x - 1.0), random.uniform(0, g.size.y - 1.0),
                           random.uniform(0, g.size.z - 1.0)};
            const int i = static_cast<int>(std::lround(v.x)),
                      j = static_cast<int>(std::lround(v.y)),
                      k = static_cast<int>(std::lround(v.z));
            const std::uint32_t packed = result_.boundary.at(i, j, k);
            if (packed == kNoBoundary) continue;
            const std::optional<Point3> ct = inner_ct_point(inverse_map, g.point_from_voxel(v));
            if (!ct) continue;
            const BoundaryRecord r = unpack_boundary(packed);
            const double d = r.distance_vx + dot(r.normal, Vector3{v.x - i, v.y - j, v.z - k});
            const int own = result_.volume.voxels[g.index(i, j, k)];
            right += (d >= 0 ? own : r.second_label) == analytic_torso_label(*ct);
            ++count;
        }
        return static_cast<double>(right) / count;
    }

  private:
    // Empty near the block's own faces, which are no anatomy.
    std::optional<Point3> inner_ct_point(const InverseMap& inverse_map, Point3 p) const {
        float x, y, z;
        MapStatus status;
        inverse_map.invert_row(p, {1, 0, 0}, 1, &x, &y, &z, &status);
        if (status != MapStatus::ok) return {};
        const Point3 ct{x, y, z};
        const Box3 box = ct_.grid.bounds();
        for (int a = 0; a < 3; ++a) {
            if (ct[a] <= box.lower[a] + 6 || ct[a] >= box.upper[a] - 6) return {};
        }
        return ct;
    }

    LabelVolume ct_;
    Registration registration_ = analytic_torso_truth();
    ResampleResult result_;
};

inline double percentile(std::vector<double> values, double part) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

}  // namespace sonocase::pipeline::testing
