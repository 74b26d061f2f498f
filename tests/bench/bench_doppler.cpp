// SPDX-License-Identifier: Apache-2.0

// What the Doppler modes cost, and what more pulses and gate points buy.
//   Doppler/colour_third     a box of a third of the sector over a vessel of 8 mm: one frame
//   Doppler/colour_flash     the same while the tissue moves, so that every cell is filled
//   Doppler/colour_empty     a box without blood
//   Doppler/spectral_line    per line of spectrum, 200 of which make a second
//   Doppler/gate             finding the points of the gate, once a frame
//   Accuracy/doppler/ensemble/N     time of a frame, and error: rms of velocity by the limit, 15 dB
//   Accuracy/doppler/gate_points/N  time of a line, and error: spread of the peak velocity
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "formats/base/constants.h"
#include "formats/flow/flow_velocity.h"
#include "runtime/imaging/doppler/colour_image.h"
#include "runtime/imaging/doppler/spectral_strip.h"

namespace sonocase::bench {
namespace {

using namespace runtime;
using namespace runtime::doppler;

class StillTissue final : public TissuePlace {
  public:
    Point3 rest(PlanePoint shown) const override { return {shown.x, 0, shown.z}; }
    Vector3 velocity_mm_s(PlanePoint) const override { return moving; }
    bool closed(Point3) const override { return false; }
    bool presses() const override { return false; }
    bool blocks(PlanePoint shown) const override { return shown.z > 1e6; }
    Rigid mannequin_from_probe() const override { return {}; }
    Vector3 moving;
};

// Vessels every 60 mm, one of them in the box at 55 degrees; 480 nodes in all, as in a torso.
FlowField vessels() {
    FlowField field;
    const double a = 55 * kPi / 180;
    const Vector3 d{std::sin(a), 0, -std::cos(a)};
    for (int v = 0; v < 8; ++v) {
        FlowVessel vessel;
        vessel.name = "vessel";
        vessel.mean_ml_s = 8;
        vessel.exponent = 3;
        for (std::size_t h = 0; h < 10; ++h)
            vessel.wave[h] = {1.0f / static_cast<float>(h + 1), -0.7f / static_cast<float>(h + 1)};
        vessel.nodes = 60;
        vessel.first_node = static_cast<int>(field.nodes.size());
        for (int i = 0; i < vessel.nodes; ++i) {
            FlowNode node;
            node.centre = Point3{0, 60.0 * v, 70} + (3.0 * (i - 30)) * d;
            node.direction = d;
            node.radius_mm.fill(4);
            field.nodes.push_back(node);
        }
        field.vessels.push_back(vessel);
    }
    return field;
}

struct Scan {
    Scan() {
        Probe probe;  // curvilinear, 150 mm deep
        geometry = make_scan_geometry(probe, 192, 512, 512, 512);
        settings.mode = DopplerMode::colour;
        settings.box_left = 0.33;
        settings.box_right = 0.67;
        settings.box_top_mm = 5;
        settings.box_bottom_mm = 145;
        settings.scale_cm_s = 60;
    }
    FlowField field = vessels();
    FlowScene scene{field, 60.0 / 70};
    ScanGeometry geometry;
    StillTissue tissue;
    DopplerSettings settings;
    std::vector<std::uint8_t> grey = std::vector<std::uint8_t>(512 * 512, 30),
                              overlay = std::vector<std::uint8_t>(512 * 512);
};

void colour(benchmark::State& state, Scan& scan) {
    ColourImage image(scan.scene, scan.geometry, 3.5, 70);
    std::uint32_t frame = 0;
    ColourReport report;
    for (auto _ : state)
        report = image.render(scan.settings, {0.15, 0.5, ++frame, 1}, scan.tissue, scan.grey,
                              scan.overlay);
    state.counters["blood_cells"] = report.blood_cells;
    state.counters["shown_cells"] = report.shown_cells;
    state.counters["cells"] = report.cells;
}

void colour_third(benchmark::State& state) {
    Scan scan;
    colour(state, scan);
}
void colour_flash(benchmark::State& state) {
    Scan scan;
    scan.tissue.moving = {0, 0, 80};
    colour(state, scan);
}
void colour_empty(benchmark::State& state) {
    Scan scan;
    scan.settings.box_top_mm = 110;
    scan.settings.box_left = 0.6;
    scan.settings.box_right = 0.93;
    colour(state, scan);
}

void ensemble(benchmark::State& state) {
    Scan scan;
    scan.settings.ensemble = static_cast<int>(state.range(0));
    scan.settings.persistence = 1;
    ColourImage image(scan.scene, scan.geometry, 3.5, 70);
    double square = 0, count = 0;
    std::uint32_t frame = 0;
    for (auto _ : state) {
        image.render(scan.settings, {0.15, 0.5, ++frame, 1}, scan.tissue, scan.grey, scan.overlay);
        state.PauseTiming();
        for (int row = 2; row + 2 < image.box().rows; ++row)
            for (int line = 2; line + 2 < image.box().lines; ++line) {
                const ColourCell cell = image.cell(line, row);
                if (!cell.shown || !cell.blood || std::abs(cell.truth) < 0.1f) continue;
                const double error = 2 * static_cast<double>(cell.turns - cell.truth);
                square += error * error;
                ++count;
            }
        state.ResumeTiming();
    }
    state.counters["error"] = std::sqrt(square / std::max(count, 1.0));
}

void spectral(benchmark::State& state, int points, bool error) {
    Scan scan;
    scan.settings.gate_depth_mm = 70;
    scan.settings.gate_mm = 4;
    scan.settings.angle_deg = 55;
    scan.settings.spectral_scale_cm_s = 80;
    scan.settings.gate_points = points;
    SpectralStrip strip(scan.scene, scan.geometry, 3.5, 1);
    double sum = 0, square = 0, count = 0;
    std::int64_t line = 0;
    strip.advance(scan.settings, 0, 70, 0, scan.tissue);
    for (auto _ : state) {
        // A second at once, so that finding the gate weighs little.
        line += kLinesPerSecond;
        strip.advance(scan.settings, static_cast<double>(line) / kLinesPerSecond, 70, 0,
                      scan.tissue);
        if (!error) continue;
        state.PauseTiming();
        const double psv = strip.measures().psv_cm_s;
        sum += psv;
        square += psv * psv;
        ++count;
        state.ResumeTiming();
    }
    state.counters["per_line"] =
        benchmark::Counter(kLinesPerSecond, benchmark::Counter::kIsIterationInvariantRate |
                                                benchmark::Counter::kInvert);
    if (error && count > 0) {
        const double mean = sum / count;
        state.counters["error"] = std::sqrt(std::max(square / count - mean * mean, 0.0)) / mean;
    }
}

void spectral_line(benchmark::State& state) {
    spectral(state, 64, false);
}
void gate_points(benchmark::State& state) {
    spectral(state, static_cast<int>(state.range(0)), true);
}

void gate(benchmark::State& state) {
    Scan scan;
    scan.settings.gate_depth_mm = 70;
    scan.settings.gate_mm = 4;
    SpectralGate aimed(scan.scene);
    for (auto _ : state)
        benchmark::DoNotOptimize(aimed.aim(scan.geometry, scan.settings, scan.tissue).blood);
}

BENCHMARK(colour_third)->Name("Doppler/colour_third")->Unit(benchmark::kMicrosecond);
BENCHMARK(colour_flash)->Name("Doppler/colour_flash")->Unit(benchmark::kMicrosecond);
BENCHMARK(colour_empty)->Name("Doppler/colour_empty")->Unit(benchmark::kMicrosecond);
BENCHMARK(spectral_line)->Name("Doppler/spectral_line")->Unit(benchmark::kMicrosecond);
BENCHMARK(gate)->Name("Doppler/gate")->Unit(benchmark::kMicrosecond);
BENCHMARK(ensemble)
    ->Name("Accuracy/doppler/ensemble")
    ->Arg(4)
    ->Arg(6)
    ->Arg(8)
    ->Arg(10)
    ->Arg(12)
    ->Arg(16);
BENCHMARK(gate_points)
    ->Name("Accuracy/doppler/gate_points")
    ->Arg(8)
    ->Arg(16)
    ->Arg(32)
    ->Arg(64)
    ->Arg(256);

}  // namespace
}  // namespace sonocase::bench
