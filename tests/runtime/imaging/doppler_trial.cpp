// SPDX-License-Identifier: Apache-2.0

// doppler_trial colour PULSES PERSISTENCE, or doppler_trial spectrum POINTS: what pulses and points
// of the gate buy. For `sonocase tradeoff --suite colour` and `spectrum`.
//
// Prints one JSON object {error, seconds, note}. colour: a tube of 8 mm at 55 degrees, a third of a
// sector; standard deviation over forty frames of a cell's velocity, root mean square over the
// vessel's cells, by the Nyquist velocity, and the fastest frame. spectrum: the same tube, pulsing,
// gate of 4 mm; root mean square error of the peak velocity in 24 times 5 s by its truth, and the
// fastest line of a second's 200.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "doppler_cases.h"
#include "formats/base/constants.h"
#include "formats/flow/flow_velocity.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/spectral_strip.h"

namespace {

using namespace sonocase;
using namespace sonocase::runtime;
using namespace sonocase::runtime::doppler;

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

ScanGeometry sector() {
    Probe probe;
    probe.depth_mm = 150;
    return make_scan_geometry(probe, 192, 512, 512, 512);
}

void colour(int pulses, int persistence) {
    const ScanGeometry geometry = sector();
    const FlowScene scene(doppler::testing::tube_at(70, 55, 4, 8), 60.0 / 70);
    ColourImage image(scene, geometry, 3.5, 70);
    const doppler::testing::StillTissue tissue;
    DopplerSettings settings;
    settings.mode = DopplerMode::colour;
    settings.box_left = 0.33;
    settings.box_right = 0.67;
    settings.box_top_mm = 5;
    settings.box_bottom_mm = 145;
    settings.scale_cm_s = 60;
    settings.ensemble = pulses;
    settings.persistence = persistence;
    std::vector<std::uint8_t> grey(512 * 512, 30), overlay(grey.size());
    constexpr std::uint32_t kFrames = 40;
    std::vector<double> sum(static_cast<std::size_t>(kColourLines) * kColourRows),
        square(sum.size());
    double fastest = 1e9, hz = 0;
    // Every fourth frame: persistence blends up to four.
    for (std::uint32_t frame = 1; frame <= 4 * kFrames; ++frame) {
        const auto start = std::chrono::steady_clock::now();
        hz = image.render(settings, {0.15, 0.5, frame, 1}, tissue, grey, overlay).frame_hz;
        fastest = std::min(fastest, seconds_since(start));
        for (int row = 0; frame % 4 == 0 && row < image.box().rows; ++row)
            for (int line = 0; line < image.box().lines; ++line) {
                const auto at = static_cast<std::size_t>(row * kColourLines + line);
                const auto turns = static_cast<double>(image.cell(line, row).turns);
                sum[at] += turns / kFrames;
                square[at] += turns * turns / kFrames;
            }
    }
    double variance = 0;
    int count = 0;
    for (int row = 2; row + 2 < image.box().rows; ++row)
        for (int line = 2; line + 2 < image.box().lines; ++line) {
            // The middle of the vessel: at its wall velocities differ within a cell.
            bool middle = true;
            for (int k = -2; k <= 2; ++k)
                middle =
                    middle && image.cell(line, row + k).blood && image.cell(line + k, row).blood;
            if (!middle) continue;
            const auto at = static_cast<std::size_t>(row * kColourLines + line);
            variance += square[at] - sum[at] * sum[at];
            ++count;
        }
    std::printf("{\"error\": %.6g, \"seconds\": %.6g, \"note\": \"%.1f frames a second\"}\n",
                2 * std::sqrt(variance / std::max(count, 1)), fastest, hz);
}

void spectrum(int points) {
    const ScanGeometry geometry = sector();
    FlowWave leg{};
    leg[0] = {1.2f, -1.5f};
    leg[1] = {0.6f, -1.6f};
    leg[2] = {-0.5f, -0.9f};
    const FlowField field = doppler::testing::tube_at(70, 55, 4, 4, 2, leg);
    const double truth = velocity_range(field.vessels[0], kPi * 16, 60.0 / 70).peak / 10;
    const FlowScene scene(field, 60.0 / 70);
    const doppler::testing::StillTissue tissue;
    DopplerSettings settings;
    settings.mode = DopplerMode::spectral;
    settings.gate_depth_mm = 70;
    settings.gate_mm = 4;
    settings.angle_deg = 55;
    settings.spectral_scale_cm_s = 80;
    settings.gate_points = points;
    double sum = 0, square = 0, fastest = 1e9;
    constexpr int kWindows = 24, kSeconds = 5;
    for (std::uint32_t seed = 1; seed <= kWindows; ++seed) {
        SpectralStrip strip(scene, geometry, 3.5, seed);
        for (int second = 0; second <= kSeconds; ++second) {
            const auto start = std::chrono::steady_clock::now();
            strip.advance(settings, second, 70, 0, tissue);
            if (second > 0) fastest = std::min(fastest, seconds_since(start) / kLinesPerSecond);
        }
        const double error = strip.measures().psv_cm_s / truth - 1;
        sum += error;
        square += error * error;
    }
    std::printf("{\"error\": %.6g, \"seconds\": %.6g, \"note\": \"bias %.2f %%\"}\n",
                std::sqrt(square / kWindows), fastest, 100 * sum / kWindows);
}

}  // namespace

int main(int count, char** words) {
    const std::string mode = count > 1 ? words[1] : "";
    const auto number = [&](int i) { return count > i ? std::atoi(words[i]) : 0; };
    if (mode == "colour" && count == 4) {
        colour(number(2), number(3));
    } else if (mode == "spectrum" && count == 3) {
        spectrum(number(2));
    } else {
        std::fprintf(stderr,
                     "usage: doppler_trial colour PULSES PERSISTENCE, or spectrum POINTS\n");
        return 2;
    }
    return 0;
}
