// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/physical/reference/reference_surface.h"

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {

using namespace physical;

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
    near.distance_mm = smooth + in.scene.roughness_mm * roughness_at(in.scene, v).shift;
    near.normal = slope / std::max(norm(slope), 1e-3);
    return near;
}

bool gives_way(const ReferenceInput& in, const Sample& p) {
    return in.scene.looks[static_cast<std::size_t>(p.place.label)].kind == TissueKind::soft;
}

}  // namespace

void meet_surface(const ReferenceInput& in, Vector3 beam, Sample& p) {
    const Place& place = p.place;
    if (place.second < 0) return;
    const PairEcho& pair =
        in.scene.pairs[static_cast<std::size_t>(place.own * in.scene.labels() + place.second)];
    const double cosine = std::abs(dot(place.normal, beam));
    p.facing = pair.hard ? 0.25 * cosine + 0.75 * std::pow(cosine, 6)
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
    if (!gives_way(in, p)) return;
    for (const TargetBall& t : in.scene.targets) {
        const NearTarget near = near_target(in, t, p.v);
        if (near.reached && near.distance_mm < 0) p.look_index = t.look;
    }
}

void meet_targets(const ReferenceInput& in, Vector3 beam, Sample& p) {
    if (!gives_way(in, p)) return;
    for (const TargetBall& t : in.scene.targets) {
        const NearTarget near = near_target(in, t, p.v);
        if (!near.reached) continue;
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

}  // namespace sonocase::runtime
