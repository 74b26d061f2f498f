// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pathology/carry_into_region.h"

#include <cmath>
#include <utility>

#include "formats/volume/boundary_record.h"

namespace sonocase::pipeline::inline pathology {
namespace {

std::uint32_t record_at(const BoundaryBricks& boundary, Int3 v) {
    return boundary.table.empty() ? kNoBoundary : boundary.at(v.x, v.y, v.z);
}

struct FineVoxel {
    std::uint8_t label = 0;
    std::uint32_t record = kNoBoundary;
};

// A voxel of the region inside a painted voxel of the case. from_centre: its centre from that of
// the case's voxel, in voxels of the case. ratio: voxels of the region along one of those.
FineVoxel painted(
    std::uint8_t label, std::uint32_t bits, Vector3 from_centre, double ratio, double reach_vx) {
    FineVoxel out{label, kNoBoundary};
    if (bits == kNoBoundary) return out;
    BoundaryRecord r = unpack_boundary(bits);
    double distance = (r.distance_vx + dot(r.normal, from_centre)) * ratio;
    if (distance < 0) {
        out.label = static_cast<std::uint8_t>(r.second_label);
        r.second_label = label;
        r.normal = -r.normal;
        distance = -distance;
    }
    if (distance > reach_vx) return out;
    r.distance_vx = distance;
    out.record = pack_boundary(r);
    return out;
}

}  // namespace

std::size_t carry_into_region(const PaintedLabels& before,
                              const PaintedLabels& after,
                              double reach_vx,
                              FineRegion* region) {
    const Grid &coarse = after.volume.grid, &fine = region->grid;
    const double ratio = coarse.spacing_mm.x / fine.spacing_mm.x;
    std::vector<std::uint8_t> labels;
    std::vector<std::uint32_t> records;
    std::size_t changed = 0;
    for (int k = 0; k < fine.size.z; ++k) {
        for (int j = 0; j < fine.size.y; ++j) {
            for (int i = 0; i < fine.size.x; ++i) {
                const Point3 at = coarse.voxel_from_point(fine.point_from_voxel(
                    {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)}));
                const Int3 v{static_cast<int>(std::floor(at.x + 0.5)),
                             static_cast<int>(std::floor(at.y + 0.5)),
                             static_cast<int>(std::floor(at.z + 0.5))};
                if (!coarse.contains(v.x, v.y, v.z)) continue;
                const std::size_t voxel = coarse.index(v.x, v.y, v.z);
                const std::uint8_t label = after.volume.voxels[voxel];
                const std::uint32_t bits = record_at(after.boundary, v);
                if (label == before.volume.voxels[voxel] && bits == record_at(before.boundary, v))
                    continue;
                if (labels.empty()) {
                    labels = dense_from_bricks(region->label_bricks);
                    if (!region->boundary.table.empty())
                        records = dense_from_bricks<std::uint32_t>(region->boundary);
                }
                const FineVoxel made =
                    painted(label, bits, {at.x - v.x, at.y - v.y, at.z - v.z}, ratio, reach_vx);
                const std::size_t to = fine.index(i, j, k);
                labels[to] = made.label;
                if (!records.empty()) records[to] = made.record;
                ++changed;
            }
        }
    }
    if (changed == 0) return 0;
    region->label_bricks = bricks_from_dense<std::uint8_t>(labels, fine.size);
    if (records.empty()) return changed;
    // Patches are left out: the packer fits them anew.
    const int step = region->boundary.patches.step;
    region->boundary = BoundaryBricks(bricks_from_dense<std::uint32_t>(records, fine.size));
    region->boundary.patches.step = step;
    return changed;
}

}  // namespace sonocase::pipeline::inline pathology
