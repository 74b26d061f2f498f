// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/flow_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "formats/base/constants.h"
#include "pipeline/flow/vessel_parts.h"

namespace sonocase::pipeline::inline flow {
namespace {

// The shapes are (assumed), from published resistive indices and the triphasic pattern of a leg at
// rest.
constexpr WavePoint kLeg[] = {{0, .3},     {.05, 2.5}, {.12, 7.6}, {.20, 5.2}, {.30, .4},
                              {.38, -1.6}, {.48, -.2}, {.60, .7},  {.75, .45}, {.9, .3}};
constexpr WavePoint kRenal[] = {{0, .66},    {.06, 1.35}, {.13, 1.95}, {.25, 1.5},
                                {.35, 1.25}, {.45, 1.1},  {.6, .95},   {.8, .8}};
constexpr WavePoint kCoeliac[] = {{0, .62},    {.06, 1.5}, {.13, 2.1}, {.25, 1.5},
                                  {.35, 1.15}, {.45, 1.1}, {.6, .95},  {.8, .75}};
constexpr WavePoint kGut[] = {{0, .45},  {.05, 1.6}, {.12, 3.6}, {.22, 2.2}, {.33, .6},
                              {.42, .8}, {.55, .9},  {.75, .6},  {.9, .5}};

template <std::size_t N>
FlowWave wave_of(const WavePoint (&points)[N]) {
    return wave_through(points, static_cast<int>(N));
}

FlowWave cosines(double first, double second, double phase) {
    FlowWave wave{};
    const double a = 2 * kPi * phase;
    wave[0] = {static_cast<float>(first * std::cos(a)), static_cast<float>(-first * std::sin(a))};
    wave[1] = {static_cast<float>(second * std::cos(2 * a)),
               static_cast<float>(-second * std::sin(2 * a))};
    return wave;
}

}  // namespace

FlowWave wave_through(const WavePoint* points, int count) {
    const auto n = static_cast<std::size_t>(count);
    const auto at = [&](std::size_t i) { return points[i % n]; };
    const auto width = [&](std::size_t i) {
        const double w = at(i + 1).phase - at(i).phase;
        return w > 0 ? w : w + 1;
    };
    const auto slope = [&](std::size_t i) { return (at(i + 1).value - at(i).value) / width(i); };
    std::vector<double> tangent(n);
    for (std::size_t i = 0; i < n; ++i) {
        const double before = slope(i + n - 1), after = slope(i);
        if (before * after <= 0) continue;  // an extreme
        const double wb = width(i + n - 1), wa = width(i), a = 2 * wa + wb, b = wa + 2 * wb;
        tangent[i] = (a + b) / (a / before + b / after);
    }
    const int samples = 1024;
    std::vector<double> q;
    double mean = 0;
    for (int s = 0; s < samples; ++s) {
        const double phase = static_cast<double>(s) / samples;
        std::size_t i = n - 1;
        for (std::size_t k = 0; k < n; ++k)
            if (points[k].phase <= phase) i = k;
        double t = phase - points[i].phase;
        t = (t < 0 ? t + 1 : t) / width(i);
        const double w = width(i), u = 1 - t;
        q.push_back(at(i).value * (1 + 2 * t) * u * u + at(i + 1).value * t * t * (3 - 2 * t) +
                    w * t * u * (u * tangent[i] - t * tangent[(i + 1) % n]));
        mean += q.back() / samples;
    }
    FlowWave wave{};
    for (int h = 1; h <= kFlowHarmonics; ++h) {
        double re = 0, im = 0;
        for (int s = 0; s < samples; ++s) {
            const double angle = 2 * kPi * h * s / samples;
            re += q[s] * std::cos(angle);
            im -= q[s] * std::sin(angle);
        }
        wave[h - 1] = {static_cast<float>(2 * re / samples / mean),
                       static_cast<float>(2 * im / samples / mean)};
    }
    return wave;
}

const OutletReference& outlet_reference(Outlet outlet) {
    static const std::array<OutletReference, 8> table{{
        {"leg", 5.8, 2.35, wave_of(kLeg), 0.58},
        {"internal iliac", 3.4, 1.5, wave_of(kGut), 0.58},
        {"renal", 16, 3.5, wave_of(kRenal), 0.15},
        {"coeliac", 11.7, 3, wave_of(kCoeliac), 0.15},
        {"mesenteric", 6.3, 2.6, wave_of(kGut), 0.15},
        {"lumbar", 2, 1, wave_of(kGut), 0.3},
        {"splenic", 5.8, 1.5, wave_of(kCoeliac), 0.1},
        {"unknown", 0, 0, wave_of(kCoeliac), 0.2},
    }};
    return table[static_cast<std::size_t>(outlet)];
}

FlowWave vein_wave(FlowKind kind) {
    return kind == FlowKind::portal ? cosines(0.06, 0, 0.3) : cosines(0.12, 0.08, 0.35);
}

FlowWave named_wave(std::string_view name) {
    if (name == "artery") return wave_of(kLeg);
    if (name == "vein") return vein_wave(FlowKind::vein);
    return {};
}

VesselReference vessel_reference(std::string_view label, FlowKind kind) {
    if (kind == FlowKind::artery) {
        if (holds_word(label, "aorta")) return {775, 250, 7};
        if (holds_word(label, "iliac")) return {1150, 250, 3.5};
        if (holds_word(label, "femor")) return {1140, 250, 3};
        if (holds_word(label, "carotid")) return {850, 250, 4};
        return {0, 0, 3};
    }
    if (kind == FlowKind::portal) return {180, 20, 3};  // of the portal vein itself
    return {0, 0, holds_word(label, "cava") ? 4.0 : 3.0};
}

double usual_mean_mm_s(FlowKind kind) {
    return kind == FlowKind::artery ? 150 : kind == FlowKind::vein ? 80 : 110;
}

}  // namespace sonocase::pipeline::inline flow
