// The part of a volume that a frame of model `physical` may read, so that a bundle which is unpacked
// as it is needed has it ready. A little more than is read, never less.
#pragma once

#include <cmath>

#include "formats/voxel_blocks.h"
#include "runtime/imaging/physical_model.h"

namespace sonocase::runtime {

struct ScanReach {
    Box3 box;  // probe frame, mm
};

// Beams, closed up to the skin, as thick as the slab; look-ups jitter by four deviations.
inline ScanReach make_scan_reach(const ScanGeometry& g, const physical::Tables& t, double voxel_mm) {
    constexpr double kDeviations = 4;  // of the noise's bytes
    ScanReach out;
    double thick_mm = 0;
    for (const physical::Row& row : t.rows) thick_mm = std::max(thick_mm, row.elevation_mm);
    for (const ScanGeometry::Beam& beam : g.beams) {
        for (const double s : {0.0, g.depth_mm + physical::kMaxGapMm}) {
            const double x = beam.origin.x + s * beam.direction.x,
                         z = beam.origin.z + s * beam.direction.z;
            out.box.include({x, -kDeviations * thick_mm, z});
            out.box.include({x, kDeviations * thick_mm, z});
        }
    }
    // The nearest voxel of a place that jitters.
    const double rim = (kDeviations * physical::kLookupJitter + 1) * voxel_mm + 0.1;
    out.box.lower = out.box.lower - Vector3{rim, rim, rim};
    out.box.upper = out.box.upper + Vector3{rim, rim, rim};
    return out;
}

// shift_mm: how far the anatomy may have moved. Neither allocates nor throws.
inline void unpack_reach(VoxelBlocks& blocks,
                         const ScanReach& reach,
                         const Grid& grid,
                         const Rigid& volume_from_probe,
                         double shift_mm) noexcept {
    const Rigid probe_from_volume = inverse(volume_from_probe);
    const Matrix3& turn = probe_from_volume.rotation;
    blocks.need([&](Int3 lower, Int3 upper) {
        const Point3 centre = probe_from_volume *
                              grid.point_from_voxel({0.5 * (lower.x + upper.x),
                                                     0.5 * (lower.y + upper.y),
                                                     0.5 * (lower.z + upper.z)});
        const double half_mm = 0.5 * grid.spacing_mm.x * (upper.x - lower.x + 1) + shift_mm;
        for (int axis = 0; axis < 3; ++axis) {
            const double radius = half_mm * (std::abs(turn(axis, 0)) + std::abs(turn(axis, 1)) +
                                             std::abs(turn(axis, 2)));
            if (centre[axis] + radius < reach.box.lower[axis] ||
                centre[axis] - radius > reach.box.upper[axis])
                return false;
        }
        return true;
    });
}

}  // namespace sonocase::runtime
