// SPDX-License-Identifier: Apache-2.0

#include "formats/flow/flow_velocity.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "formats/base/constants.h"

namespace sonocase {
namespace {

using Complex = std::complex<double>;

// J0 and J1 / (z / 2) by their power series. Along i^(3/2) the terms grow to exp(|z|) and the sum
// to exp(|z| / sqrt 2): at |z| = 60, beyond any vessel, eight digits remain.
struct Bessel {
    Complex j0, j1_over_half_z;
};
Bessel bessel(Complex z) {
    const Complex square = -0.25 * z * z;
    Complex term = 1, j0 = 1, other = 1, j1 = 1;
    for (int k = 1; k < 400; ++k) {
        term *= square / static_cast<double>(k * k);
        other *= square / static_cast<double>(k * (k + 1));
        j0 += term;
        j1 += other;
        if (std::abs(term) < 1e-17 * std::abs(j0) && std::abs(other) < 1e-17 * std::abs(j1)) break;
    }
    return {j0, j1};
}

// Weights such that sum_i w_i u_i is the integral of 2 rho u drho for a u that is linear between
// the nodes.
std::array<double, kProfileRadii> weights() {
    constexpr double h = 1.0 / (kProfileRadii - 1);
    std::array<double, kProfileRadii> w{};
    for (int i = 0; i + 1 < kProfileRadii; ++i) {
        const double a = i * h, b = a + h;
        w[i] += h * (2 * a + b) / 3;
        w[i + 1] += h * (a + 2 * b) / 3;
    }
    return w;
}

double radius_at(const FlowNode& node, double turns) {
    const double at = turns * kFlowRays;
    const auto i = static_cast<std::size_t>(at);
    const double part = at - static_cast<double>(i);
    return (1 - part) * static_cast<double>(node.radius_mm[i % kFlowRays]) +
           part * static_cast<double>(node.radius_mm[(i + 1) % kFlowRays]);
}

}  // namespace

FlowProfile::FlowProfile(const FlowVessel& vessel, double radius_mm, double beat_s)
    : breathing_(vessel.breathing) {
    const auto w = weights();
    const auto n = static_cast<double>(vessel.exponent);
    std::array<double, kProfileRadii> mean{};
    double mean_sum = 0;
    for (std::size_t i = 0; i < kProfileRadii; ++i) {
        const double rho = static_cast<double>(i) / (kProfileRadii - 1);
        mean[i] = i + 1 == kProfileRadii ? 0 : 1 - std::pow(rho, n);
        mean_sum += w[i] * mean[i];
    }
    for (std::size_t i = 0; i < kProfileRadii; ++i) {
        mean[i] /= mean_sum;
        mean_[i] = static_cast<float>(mean[i]);
    }
    const Complex turn = std::polar(1.0, 0.75 * kPi);  // i^(3/2)
    for (std::size_t h = 0; h < kFlowHarmonics; ++h) {
        const Complex q(static_cast<double>(vessel.wave[h].re),
                        static_cast<double>(vessel.wave[h].im));
        if (q == Complex{}) continue;
        const double alpha = radius_mm * std::sqrt(2 * kPi * static_cast<double>(h + 1) /
                                                   (beat_s * kBloodViscosityMm2PerS));
        const Complex z = std::min(alpha, 60.0) * turn;
        const Bessel wall = bessel(z);
        std::array<Complex, kProfileRadii> u{};
        Complex sum;
        for (std::size_t i = 0; i + 1 < kProfileRadii; ++i) {
            const double rho = static_cast<double>(i) / (kProfileRadii - 1);
            u[i] = q * (1.0 - bessel(rho * z).j0 / wall.j0) / (1.0 - wall.j1_over_half_z / wall.j0);
            sum += w[i] * u[i];
        }
        // The profile is curved between the nodes, so that their sum misses the integral: correct
        // it.
        for (std::size_t i = 0; i < kProfileRadii; ++i) {
            u[i] += (q - sum) * mean[i];
            re_[h][i] = static_cast<float>(u[i].real());
            im_[h][i] = static_cast<float>(u[i].imag());
        }
    }
}

FlowProfile::Row FlowProfile::row(double phase, double inspired) const {
    const UnitCircle one = unit_circle(phase);
    Row out;
    const auto still = static_cast<float>(1 + static_cast<double>(breathing_) * (0.5 - inspired));
    for (std::size_t i = 0; i < kProfileRadii; ++i) out[i] = still * mean_[i];
    double c = 1, s = 0;
    for (std::size_t h = 0; h < kFlowHarmonics; ++h) {
        const double next = c * one.cosine - s * one.sine;
        s = c * one.sine + s * one.cosine;
        c = next;
        const auto cf = static_cast<float>(c), sf = static_cast<float>(s);
        for (std::size_t i = 0; i < kProfileRadii; ++i) out[i] += cf * re_[h][i] - sf * im_[h][i];
    }
    return out;
}

VelocityRange velocity_range(const FlowVessel& vessel, double area_mm2, double beat_s) {
    VelocityRange range;
    if (!(area_mm2 > 0)) return range;
    const FlowProfile profile(vessel, std::sqrt(area_mm2 / kPi), beat_s);
    const double scale = vessel.mean_ml_s * 1000 / area_mm2;
    range.mean = scale;
    constexpr int kPhases = 200;
    for (int p = 0; p < kPhases; ++p) {
        const FlowProfile::Row row = profile.row(static_cast<double>(p) / kPhases, 0.5);
        const auto fastest = static_cast<double>(*std::max_element(row.begin(), row.end()));
        range.peak = std::max(range.peak, scale * fastest);
        if (p == 0) range.end = scale * fastest;
    }
    return range;
}

UnitCircle unit_circle(double phase) {
    // Nearest quarter turn, then Taylor's series of what remains, at most pi / 4.
    const double turns = phase - std::floor(phase);
    const int quarter = static_cast<int>(4 * turns + 0.5);
    const double x = 2 * kPi * (turns - 0.25 * quarter), y = x * x;
    const double s =
        x * (1 + y * (-1.0 / 6 + y * (1.0 / 120 + y * (-1.0 / 5040 + y * (1.0 / 362880)))));
    const double c =
        1 +
        y * (-0.5 + y * (1.0 / 24 + y * (-1.0 / 720 + y * (1.0 / 40320 + y * (-1.0 / 3628800)))));
    switch (quarter % 4) {
        case 0: return {c, s};
        case 1: return {-s, c};
        case 2: return {-c, -s};
        default: return {s, -c};
    }
}

double median_area_mm2(const FlowField& field, const FlowVessel& vessel) {
    std::vector<double> areas;
    for (int i = 0; i < vessel.nodes; ++i)
        areas.push_back(section_area_mm2(field.nodes[vessel.first_node + i].radius_mm));
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
            // The place must lie between the planes of both sections.
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
    const int v = place.vessel;
    const double u = profile_value(profiles_[v].row(phase, inspired), place.rho);
    return (field_.vessels[v].mean_ml_s * 1000 / place.area_mm2 * u) * place.direction;
}

}  // namespace sonocase
