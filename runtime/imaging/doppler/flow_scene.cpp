// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/flow_scene.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/flow/flow_velocity.h"
#include "runtime/imaging/doppler/doppler_maths.h"

namespace sonocase::runtime::doppler {
namespace {

Float3 to_float(Vector3 v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

float ray(const float* radius, float turns) {
    const float at = turns * kFlowRays;
    const int i = std::min(static_cast<int>(at), kFlowRays - 1);
    return radius[i] + (at - static_cast<float>(i)) * (radius[i + 1] - radius[i]);
}

}  // namespace

FlowScene::FlowScene(const FlowField& field, double beat_s) {
    Box3 box;
    for (const FlowNode& node : field.nodes) box.include(node.centre);
    if (!box.empty()) origin_ = box.centre();
    for (std::size_t v = 0; v < field.vessels.size(); ++v) {
        const FlowVessel& vessel = field.vessels[v];
        veins_.push_back(vessel.kind != FlowKind::artery);
        mean_ml_s_.push_back(vessel.mean_ml_s);
        const double area = median_area_mm2(field, vessel);
        profiles_.push_back(area > 0 ? FlowProfile(vessel, std::sqrt(area / kPi), beat_s)
                                     : FlowProfile());
        const auto axes = section_axes(field, vessel);
        for (int i = 0; i + 1 < vessel.nodes; ++i) {
            const int at = vessel.first_node + i;
            const FlowNode &a = field.nodes[at], &b = field.nodes[at + 1];
            FlowCapsule c;
            c.a = local(a.centre);
            c.b = local(b.centre);
            c.along_a = to_float(a.direction);
            c.along_b = to_float(b.direction);
            c.first_a = to_float(axes[i].first);
            c.second_a = to_float(axes[i].second);
            c.first_b = to_float(axes[i + 1].first);
            c.second_b = to_float(axes[i + 1].second);
            c.slowness_a = static_cast<float>(section_area_mm2(a.radius_mm) /
                                              (1000 * vessel.mean_ml_s + 1e-9));
            c.slowness_b = static_cast<float>(section_area_mm2(b.radius_mm) /
                                              (1000 * vessel.mean_ml_s + 1e-9));
            float widest = 0;
            for (std::size_t r = 0; r <= kFlowRays; ++r) {
                c.radius_a[r] = a.radius_mm[r % kFlowRays];
                c.radius_b[r] = b.radius_mm[r % kFlowRays];
                widest = std::max({widest, c.radius_a[r], c.radius_b[r]});
            }
            c.widest_square = 1.0001f * widest * widest;
            c.middle = 0.5f * (c.a + c.b);
            const Float3 half = c.b - c.middle;
            c.reach = std::sqrt(dot(half, half)) + widest + 0.01f;
            c.vessel = static_cast<std::int32_t>(v);
            all_.push_back(static_cast<std::int32_t>(capsules_.size()));
            capsules_.push_back(c);
        }
    }
}

FlowHit FlowScene::find(Float3 p, std::span<const std::int32_t> among) const {
    FlowHit best;
    for (const std::int32_t index : among) {
        const FlowCapsule& c = capsules_[index];
        const float past = dot(p - c.a, c.along_a), before = dot(c.b - p, c.along_b);
        if (!(past >= 0 && before >= 0 && past + before > 0)) continue;
        const float t = past / (past + before), u = 1 - t;
        const Float3 out = p - (u * c.a + t * c.b);
        const float square = dot(out, out);
        // Farther out than the widest ray reaches, or than the best so far: no angle is needed.
        if (square > best.rho * best.rho * c.widest_square) continue;
        const float x = dot(out, u * c.first_a + t * c.first_b),
                    y = dot(out, u * c.second_a + t * c.second_b);
        float turns = turns_of(y, x);
        turns = turns < 0 ? turns + 1 : turns;
        const float radius = u * ray(c.radius_a, turns) + t * ray(c.radius_b, turns);
        const float away = std::sqrt(square), rho = away / radius;
        if (!(rho < best.rho)) continue;
        best.rho = rho;
        best.vessel = c.vessel;
        best.along = u * c.along_a + t * c.along_b;
        best.per_area = 1 / (u * c.slowness_a + t * c.slowness_b);
        best.edge_mm = radius - away;
    }
    return best;
}

int FlowScene::near(Float3 middle,
                    float reach,
                    std::span<const std::int32_t> among,
                    std::span<std::int32_t> out) const {
    int count = 0;
    for (const std::int32_t index : among) {
        const FlowCapsule& c = capsules_[index];
        const Float3 d = c.middle - middle;
        const float limit = c.reach + reach;
        if (dot(d, d) <= limit * limit) out[count++] = index;
    }
    return count;
}

FlowMoment::FlowMoment(const FlowScene& scene)
    : scene_(scene), rows_(scene.vessels()), known_(scene.vessels(), 0) {}

void FlowMoment::begin(double phase, double inspired) {
    if (phase == phase_ && inspired == inspired_) return;  // what is known stays
    phase_ = phase;
    inspired_ = inspired;
    std::fill(known_.begin(), known_.end(), std::uint8_t{0});
}

const FlowProfile::Row& FlowMoment::row(int vessel) {
    if (known_[vessel] == 0) {
        rows_[vessel] = scene_.profile(vessel).row(phase_, inspired_);
        known_[vessel] = 1;
    }
    return rows_[vessel];
}

float FlowMoment::greatest(int vessel) {
    float largest = 0;
    for (const float u : row(vessel)) largest = std::max(largest, std::abs(u));
    return largest;
}

float FlowMoment::speed(const FlowHit& hit) {
    const float at = hit.rho * (kProfileRadii - 1);
    const int i = std::min(static_cast<int>(at), kProfileRadii - 2);
    const FlowProfile::Row& row = this->row(hit.vessel);
    return hit.per_area * (row[i] + (at - static_cast<float>(i)) * (row[i + 1] - row[i]));
}

}  // namespace sonocase::runtime::doppler
