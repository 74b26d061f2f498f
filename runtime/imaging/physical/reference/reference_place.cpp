// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_place.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/volume/boundary_record.h"

namespace sonocase::runtime {

using namespace physical;

int nearest_integer(double x) {
    return static_cast<int>(std::nearbyint(std::clamp(x, -1e6, 1e6)));
}

double echo_offset_db(const PhysicalScene& s, Point3 v) {
    const int i = nearest_integer(v.x), j = nearest_integer(v.y), k = nearest_integer(v.z);
    if (!s.words.has_echo() || !s.grid.contains(i, j, k)) return 0;
    return s.bundle->echo_offset.at(i, j, k) / 4.0;
}

double fine_offset_db(const PhysicalScene& s, const PhysicalEffects& on, int label, Point3 v) {
    if (label >= static_cast<int>(s.fine.frames.size())) return 0;
    const FineFrame& f = s.fine.frames[static_cast<std::size_t>(label)];
    if (f.cube < 0 || !(f.cube == kParenchymaCube ? on.parenchyma : on.fine_structure)) return 0;
    std::array<int, 3> cell{};
    for (int r = 0; r < 3; ++r) {
        const auto m = [&](int c) {
            return static_cast<double>(f.cube_from_voxel[static_cast<std::size_t>(3 * r + c)]);
        };
        const double u = m(0) * v.x + m(1) * v.y + m(2) * v.z;
        cell[static_cast<std::size_t>(r)] =
            nearest_integer(u) & ((r == 0 ? kFineLayers[f.cube] : kFineEdge) - 1);
    }
    return s.textures->fine[fine_index(cell[0], cell[1], cell[2]) +
                            static_cast<std::size_t>(f.cube) * kFineEdge * kFineEdge * kFineEdge] /
           4.0;
}

Roughness roughness_at(const PhysicalScene& s, Point3 v) {
    const auto wrap = [&](double voxel) {
        return static_cast<std::size_t>(nearest_integer(voxel * s.voxel_mm / kRoughVoxelMm) &
                                        (kRoughEdge - 1));
    };
    const std::uint32_t bits =
        s.textures->rough[wrap(v.x) + kRoughEdge * (wrap(v.y) + kRoughEdge * wrap(v.z))];
    const auto byte = [&](int n) {
        return static_cast<double>(static_cast<std::int8_t>(bits >> (8 * n) & 0xFF));
    };
    return {byte(0) / 32, byte(1) / 32, byte(2) / 127, byte(3) / 127};
}

namespace {

// The voxel nearest to a point of a volume: its label, and its record if that counts. at: where the
// plane is extended to.
struct Voxel {
    int label = 0;
    std::uint32_t record = kNoBoundary;
    Vector3 from_centre;
    double mm = 1;
};

Voxel voxel_at(const PhysicalScene& s,
               const Grid& grid,
               const BrickVolume<std::uint8_t>& labels,
               const BrickVolume<std::uint32_t>* boundary,
               Point3 at,
               Point3 near) {
    const int i = nearest_integer(near.x), j = nearest_integer(near.y), k = nearest_integer(near.z);
    Voxel v;
    v.mm = grid.spacing_mm.x;
    if (!grid.contains(i, j, k)) return v;
    v.label = labels.at(i, j, k);
    v.from_centre = {at.x - i, at.y - j, at.z - k};
    if (boundary == nullptr) return v;
    const std::uint32_t bits = boundary->at(i, j, k);
    if (bits == kNoBoundary || static_cast<int>(bits & 0xFF) >= s.labels()) return v;
    if (std::abs(unpack_boundary(bits).distance_vx) <= kSurfaceReachVx) v.record = bits;
    return v;
}

}  // namespace

Place place_at(const PhysicalScene& s, const PhysicalFrame& f, Point3 v, Point3 near) {
    const bool bounded = f.effects.boundaries && s.words.has_boundary();
    Voxel voxel = voxel_at(s, s.grid, s.bundle->label_bricks,
                           bounded ? &s.bundle->boundary : nullptr, v, near);
    double least_mm = -1e9;  // distance at rest that the surface has at least
    if (s.region.region != nullptr && s.region.place.contains(v)) {
        const FineRegion& region = *s.region.region;
        const Point3 at = s.region.place.voxel_of(v);
        const Voxel fine =
            voxel_at(s, region.grid, region.label_bricks,
                     bounded && s.region.words.has_boundary() ? &region.boundary : nullptr, at,
                     at + (near - v));
        if (fine.record == kNoBoundary) least_mm = 0;
        if (fine.record != kNoBoundary || voxel.label != fine.label) voxel = fine;
    }
    Place p;
    p.own = p.label = voxel.label;
    if (voxel.record == kNoBoundary) return p;
    const BoundaryRecord r = unpack_boundary(voxel.record);
    p.second = r.second_label;
    p.normal = r.normal;
    p.rough = roughness_at(s, v);
    const double plane_mm = (r.distance_vx + dot(r.normal, voxel.from_centre)) * voxel.mm;
    p.distance_mm =
        std::max(plane_mm, least_mm) + s.roughness_mm * p.rough.shift * (p.own < p.second ? 1 : -1);
    const PairEcho& pair = s.pairs[static_cast<std::size_t>(p.own * s.labels() + p.second)];
    p.distance_mm += pair.pulse * f.motion.pulse_mm;
    if (p.distance_mm < 0) p.label = p.second;
    return p;
}

}  // namespace sonocase::runtime
