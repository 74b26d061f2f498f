// SPDX-License-Identifier: Apache-2.0

#include "formats/flow/flow_at.h"

#include <algorithm>
#include <cmath>

namespace sonocase {
namespace {

constexpr double kPi = 3.14159265358979323846;

double radius_at(const FlowNode& node, double turns) {
    const double at = turns * kFlowRays;
    const auto i = static_cast<std::size_t>(at);
    const double part = at - static_cast<double>(i);
    return (1 - part) * static_cast<double>(node.radius_mm[i % kFlowRays]) +
           part * static_cast<double>(node.radius_mm[(i + 1) % kFlowRays]);
}

}  // namespace

double median_area_mm2(const FlowField& field, const FlowVessel& vessel) {
    std::vector<double> areas;
    for (int i = 0; i < vessel.nodes; ++i)
        areas.push_back(section_area_mm2(
            field.nodes[static_cast<std::size_t>(vessel.first_node + i)].radius_mm));
    if (areas.empty()) return 0;
    const auto middle = areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2);
    std::nth_element(areas.begin(), middle, areas.end());
    return *middle;
}

double profile_value(const FlowProfile::Row& row, double rho) {
    const double at = std::clamp(rho, 0.0, 1.0) * (kProfileRadii - 1);
    const auto i =
        std::min(static_cast<std::size_t>(at), static_cast<std::size_t>(kProfileRadii - 2));
    const double part = at - static_cast<double>(i);
    return (1 - part) * static_cast<double>(row[i]) + part * static_cast<double>(row[i + 1]);
}

FlowReader::FlowReader(const FlowField& field, double beat_s) : field_(field) {
    axes_.resize(field.nodes.size());
    for (const FlowVessel& vessel : field.vessels) {
        const auto axes = section_axes(field, vessel);
        std::copy(axes.begin(), axes.end(), axes_.begin() + vessel.first_node);
        const double area = median_area_mm2(field, vessel);
        profiles_.push_back(area > 0 ? FlowProfile(vessel, std::sqrt(area / kPi), beat_s)
                                     : FlowProfile());
    }
}

FlowPlace FlowReader::find(Point3 place) const {
    FlowPlace best;
    best.rho = 1;
    for (std::size_t v = 0; v < field_.vessels.size(); ++v) {
        const FlowVessel& vessel = field_.vessels[v];
        for (int i = 0; i + 1 < vessel.nodes; ++i) {
            const auto at = static_cast<std::size_t>(vessel.first_node + i);
            const FlowNode &a = field_.nodes[at], &b = field_.nodes[at + 1];
            // Between the planes of both sections.
            const double past = dot(place - a.centre, a.direction),
                         before = dot(b.centre - place, b.direction);
            if (!(past >= 0 && before >= 0 && past + before > 0)) continue;
            const double t = past / (past + before);
            const Point3 centre = a.centre + t * (b.centre - a.centre);
            const Vector3 out = place - centre;
            const Vector3 first = (1 - t) * axes_[at].first + t * axes_[at + 1].first,
                          second = (1 - t) * axes_[at].second + t * axes_[at + 1].second;
            double turns = std::atan2(dot(out, second), dot(out, first)) / (2 * kPi);
            turns = std::clamp(turns < 0 ? turns + 1 : turns, 0.0, 1 - 1e-12);
            const double radius = (1 - t) * radius_at(a, turns) + t * radius_at(b, turns);
            const double rho = norm(out) / radius;
            if (!(rho < best.rho)) continue;
            best.vessel = static_cast<int>(v);
            best.node = i;
            best.along = t;
            best.rho = rho;
            best.direction = normalized((1 - t) * a.direction + t * b.direction);
            best.area_mm2 =
                (1 - t) * section_area_mm2(a.radius_mm) + t * section_area_mm2(b.radius_mm);
        }
    }
    return best;
}

Vector3 FlowReader::velocity(const FlowPlace& place, double phase, double inspired) const {
    if (place.vessel < 0) return {};
    const auto v = static_cast<std::size_t>(place.vessel);
    const double u = profile_value(profiles_[v].row(phase, inspired), place.rho);
    return (field_.vessels[v].mean_ml_s * 1000 / place.area_mm2 * u) * place.direction;
}

}  // namespace sonocase
