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

void find_target(const ReferenceInput& in, Vector3 beam, Sample& p) {
    const PhysicalScene& s = in.scene;
    for (const TargetBall& t : s.targets) {
        const Vector3 from_centre = s.voxel_mm * (p.v - t.centre_vx);
        const double away = norm(from_centre);
        if (away - t.radius_mm > kTargetReachMm ||
            s.looks[static_cast<std::size_t>(p.place.label)].kind != TissueKind::soft)
            continue;
        p.ball = &t;
        p.ball_mm = away - t.radius_mm + kRoughnessMm * roughness_at(s, p.v).shift;
        p.ball_cosine = std::abs(dot(from_centre, beam)) / std::max(away, 1e-3);
        if (p.ball_mm < 0) p.look_index = t.look;
    }
}

void meet_target(const ReferenceInput& in, Sample& p) {
    if (p.ball == nullptr) return;
    const Roughness rough = roughness_at(in.scene, p.v);
    if (in.frame.effects.interfaces) {
        const double u = p.ball_mm / 0.16;
        const double c2 = p.ball_cosine * p.ball_cosine;
        const double i = p.ball->wall * (0.08 * p.ball_cosine + 0.92 * c2 * c2 * c2) *
                         std::exp2(rough.log2_glint) * std::exp(-0.5 * u * u) *
                         p.row.interface_scale;
        p.re += i * rough.re;
        p.im += i * rough.im;
    }
    if (in.frame.effects.edge_shadow && p.ball->fluid)
        p.loss += graze_loss(p.ball_cosine, p.ball_mm, in.geometry.step_mm);
}

}  // namespace sonocase::runtime
