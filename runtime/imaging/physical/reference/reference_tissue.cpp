// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_tissue.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/volume/boundary_record.h"
#include "runtime/imaging/physical/model/physical_frame.h"

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
    const FineFrame& f = s.fine.frames[label];
    if (f.cube < 0 || !(f.cube == kParenchymaCube ? on.parenchyma : on.fine_structure)) return 0;
    std::array<int, 3> cell{};
    for (int r = 0; r < 3; ++r) {
        const auto m = [&](int c) { return static_cast<double>(f.cube_from_voxel[3 * r + c]); };
        const double u = m(0) * v.x + m(1) * v.y + m(2) * v.z;
        cell[r] = nearest_integer(u) & ((r == 0 ? kFineLayers[f.cube] : kFineEdge) - 1);
    }
    return s.textures->fine[fine_index(cell[0], cell[1], cell[2]) +
                            f.cube * kFineEdge * kFineEdge * kFineEdge] /
           4.0;
}

Roughness roughness_at(const PhysicalScene& s, Point3 v) {
    const auto wrap = [&](double voxel) {
        return nearest_integer(voxel * s.voxel_mm / kRoughVoxelMm) & (kRoughEdge - 1);
    };
    const std::uint32_t bits =
        s.textures->rough[wrap(v.x) + kRoughEdge * (wrap(v.y) + kRoughEdge * wrap(v.z))];
    const auto byte = [&](int n) {
        return static_cast<double>(static_cast<std::int8_t>(bits >> (8 * n) & 0xFF));
    };
    return {byte(0) / 32, byte(1) / 32, byte(2) / 127, byte(3) / 127};
}

namespace {

// The voxel nearest to a point of a volume: its label, and its record if that counts.
struct Voxel {
    int label = 0;
    std::uint32_t record = kNoBoundary;
    Vector3 from_centre;
    double mm = 1;
};

// near: the point that is looked up; at: where the plane is extended to.
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
    double min_mm = -1e9;  // the surface lies at least this far off, at rest
    if (s.region.region != nullptr && s.region.place.contains(v)) {
        const FineRegion& region = *s.region.region;
        const Point3 at = s.region.place.voxel_of(v);
        const Voxel fine =
            voxel_at(s, region.grid, region.label_bricks,
                     bounded && s.region.words.has_boundary() ? &region.boundary : nullptr, at,
                     at + (near - v));
        if (fine.record == kNoBoundary) min_mm = 0;
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
        std::max(plane_mm, min_mm) + s.roughness_mm * p.rough.shift * (p.own < p.second ? 1 : -1);
    const PairEcho& pair = s.pairs[p.own * s.labels() + p.second];
    p.distance_mm += pair.pulse * f.motion.pulse_mm;
    if (f.motion.vein_mm != 0 && f.effects.pulsation) {
        const int vein = s.is_vein[p.own] != 0 ? 1 : s.is_vein[p.second] != 0 ? -1 : 0;
        p.distance_mm += vein * f.motion.vein_mm;
    }
    if (p.distance_mm < 0) p.label = p.second;
    return p;
}

void press_place(const ReferenceInput& in, int k, int l, Vector3 beam, Place& place) {
    const ScanGeometry& g = in.geometry;
    const PhysicalFrame& f = in.frame;
    const ScanGeometry::Beam& of = g.beams[l];
    const PlanePoint d = of.direction;
    const double r = in.row(k).r_mm;
    const press::PlaneShift here = press::plane_shift(*f.press, g, of, l, r);
    const press::PlaneShift above =
        k > 0 ? press::plane_shift(*f.press, g, of, l, in.row(k - 1).r_mm) : here;
    const PlanePoint n = press::beside(d);
    if (place.second >= 0)
        physical::press_surface(beam, f.volume_from_probe.rotation * Vector3{n.x, 0, n.z},
                                1 + (here.along_mm - above.along_mm) / g.step_mm, here.tilt,
                                place.normal, place.distance_mm);
    const double lateral =
        press::follows_columns(g) ? press::lateral_of_line(g, l) : of.origin.x + r * d.x;
    const double depth = press::follows_columns(g) ? r : of.origin.z + r * d.z;
    if (f.press->closed_in_plane({lateral, depth}))
        place.label = in.scene.closed_label[place.label];
}

SpeckleSample speckle_at(
    const SpeckleSlice& slice, Vector3 place, double cell_mm, double spacing_mm, int looks) {
    const std::uint32_t patch =
        mix_patch(nearest_integer(place.x / kPatchMm), nearest_integer(place.y / kPatchMm),
                  nearest_integer(place.z / kPatchMm));
    int chosen = 0;
    while (chosen + 1 < slice.count &&
           (patch >> 16) >= std::lround(slice.sides[chosen].until * 65536))
        ++chosen;
    const SpeckleSide& side = slice.sides[chosen];

    // The block of heights; within a quarter of its ends, patches change over one by one.
    const double height = dot(side.height, place);
    double at = height / kHeightBlock;
    if (std::abs(at - std::nearbyint(at)) <= 0.25) at += 0.5 * (patch & 0xFFFFu) / 65536.0 - 0.25;
    const double block = std::floor(at), middle = (block + 0.5) * kHeightBlock;

    // The triangle around the projection, and the barycentric weights of its corners.
    const double u = dot(side.u, place) + middle * side.u_per_height,
                 v = dot(side.v, place) + middle * side.v_per_height;
    const double u0 = std::floor(u), v0 = std::floor(v), fu = u - u0, fv = v - v0;
    struct Corner {
        int du, dv;
        double blend;
    };
    const std::array<Corner, 3> corners{{{0, 0, 1 - std::max(fu, fv)},
                                         {fu > fv ? 1 : 0, fu > fv ? 0 : 1, std::abs(fu - fv)},
                                         {1, 1, std::min(fu, fv)}}};
    SpeckleSample out;
    for (const Corner& corner : corners) {
        const auto bits = [](double whole) {
            return static_cast<std::uint32_t>(static_cast<std::int32_t>(whole));
        };
        const std::uint32_t node =
            mix_node(bits(u0 + corner.du) * kNodeU + bits(v0 + corner.dv) * kNodeV +
                     bits(block) * kNodeBlock + side.base);
        // The column's scatterer nearest to the plane is `off` spacings away.
        const double begin = (node >> 9) / 8388608.0;
        const double depth = (height - middle) * side.per_normal * cell_mm / spacing_mm;
        const double step = std::nearbyint(depth - begin), off = depth - begin - step;
        const std::uint32_t phases = mix_scatterer(node, static_cast<std::int32_t>(step));
        const double weight = corner.blend * (1 - 4 * off * off) * (1 - 3 * off * off);
        for (int look = 0; look < looks; ++look) {
            out.re[look] += phases >> (31 - 2 * look) & 1 ? -weight : weight;
            out.im[look] += phases >> (30 - 2 * look) & 1 ? -weight : weight;
        }
    }
    return out;
}

namespace {

// log2 of amplitude that a beam loses in one sample where it grazes a wall of fluid.
double graze_loss(double cosine, double distance_mm, double step_mm) {
    const double graze = std::max(1 - cosine / kEdgeCos, 0.0);
    const double near = std::max(1 - std::abs(distance_mm) / kEdgeReachMm, 0.0);
    return kEdgeLossLog2PerMm * graze * graze * near * step_mm;
}

// A sample beside the surface of a target.
struct NearTarget {
    bool reached = false;
    double distance_mm = 0;  // to the rough surface, to first order; < 0 inside
    Vector3 normal;
};

NearTarget near_target(const ReferenceInput& in, const TargetBall& t, Point3 v) {
    const Vector3 from_centre = in.scene.voxel_mm * (v - t.centre_vx);
    const Vector3 slope = t.shape * from_centre;
    const double rank = std::sqrt(dot(from_centre, slope));
    const double smooth =
        t.round ? norm(from_centre) - t.radius_mm
                : (rank - t.radius_mm) * std::max(rank, 1e-3) / std::max(norm(slope), 1e-3);
    NearTarget near;
    near.reached = smooth <= kTargetReachMm;
    if (!near.reached) return near;
    if (t.only_label >= 0) {
        near.distance_mm = std::max(smooth, dot(t.level_up, from_centre) - t.level_mm);
        return near;
    }
    near.distance_mm = smooth + in.scene.roughness_mm * roughness_at(in.scene, v).shift;
    near.normal = slope / std::max(norm(slope), 1e-3);
    return near;
}

// Only soft tissue gives way to a ball, blood and other fluid to a wire, and one label to free
// fluid.
bool gives_way(const ReferenceInput& in, const Sample& p, const TargetBall& t) {
    if (t.only_label >= 0) return p.place.label == t.only_label;
    const TissueKind kind = in.scene.acoustics[p.place.label].kind;
    return kind == TissueKind::soft || (t.anywhere && kind == TissueKind::fluid);
}

const std::vector<TargetBall>& balls_of(const ReferenceInput& in) {
    return in.frame.balls != nullptr ? *in.frame.balls : in.scene.targets;
}

}  // namespace

void meet_surface(const ReferenceInput& in, Vector3 beam, Sample& p) {
    const Place& place = p.place;
    if (place.second < 0) return;
    const PairEcho& pair = in.scene.pairs[place.own * in.scene.labels() + place.second];
    const double cosine = std::abs(dot(place.normal, beam));
    p.facing = pair.diffuse ? kDiffusePart * cosine + (1 - kDiffusePart) * std::pow(cosine, 6)
                            : 0.08 * cosine + 0.92 * std::pow(cosine, 10);
    if (in.frame.effects.interfaces && pair.amplitude > 0) {
        const double u =
            (std::abs(place.distance_mm) - pair.split_mm) / blurred_mm(in.tables, pair.sigma_mm);
        const double i = pair.amplitude * p.facing * std::exp2(place.rough.log2_glint) *
                         std::exp(-0.5 * u * u) * p.row.interface_scale;
        p.re += i * place.rough.re;
        p.im += i * place.rough.im;
    }
    if (in.frame.effects.edge_shadow && pair.refracts)
        p.loss += graze_loss(cosine, place.distance_mm, in.geometry.step_mm);
}

void find_target(const ReferenceInput& in, Sample& p) {
    for (const TargetBall& t : balls_of(in)) {
        if (!gives_way(in, p, t)) continue;
        const NearTarget near = near_target(in, t, p.v);
        if (near.reached && near.distance_mm < 0) p.acoustics_index = t.acoustics;
    }
}

void meet_targets(const ReferenceInput& in, Vector3 beam, Sample& p) {
    for (const TargetBall& t : balls_of(in)) {
        if (t.only_label >= 0 || !gives_way(in, p, t)) continue;
        const NearTarget near = near_target(in, t, p.v);
        if (!near.reached) continue;
        if (t.covers && near.distance_mm < 0) {
            p.re = p.im = 0;
            p.facing = 1;
        }
        const Roughness rough = roughness_at(in.scene, p.v);
        const double cosine = std::abs(dot(near.normal, beam));
        if (in.frame.effects.interfaces) {
            const double u = near.distance_mm / 0.16;
            const double c2 = cosine * cosine;
            const double i = t.wall * (0.08 * cosine + 0.92 * c2 * c2 * c2) *
                             std::exp2(rough.log2_glint) * std::exp(-0.5 * u * u) *
                             p.row.interface_scale;
            p.re += i * rough.re;
            p.im += i * rough.im;
        }
        if (in.frame.effects.edge_shadow && t.fluid)
            p.loss += graze_loss(cosine, near.distance_mm, in.geometry.step_mm);
    }
}

WallEcho wall_echo(
    const ReferenceInput& in, Point3 above, Point3 voxel, Point3 below, double node_mm) {
    const WallTables& sheets = in.tables.wall;
    const auto place = [&](Point3 v) { return wall_place(in.scene.layers, sheets, v); };
    const WallPlace here = place(voxel), before = place(above), after = place(below);
    const auto sheet = [&](const SheetTable& table, double mm, double before_mm, double after_mm) {
        const double cosine = std::min(std::abs(after_mm - before_mm) / node_mm, 1.0);
        return static_cast<double>(table.echo[wall_step(sheets, table, here.course, mm)]) *
               std::pow(cosine, 4);
    };
    const double outer = sheet(sheets.outer, here.depth, before.depth, after.depth),
                 inner = sheet(sheets.inner, here.above, before.above, after.above);
    const double share = std::clamp(0.5 + (here.above - here.depth) / kWallBlendMm, 0.0, 1.0);
    return {outer * share + inner * (1 - share), here.above > 0,
            wall_ground_db(sheets, here.depth, here.above)};
}

}  // namespace sonocase::runtime
