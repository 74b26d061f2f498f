// SPDX-License-Identifier: Apache-2.0

// The beam-space renderer with what it needs, so that envelopes can be read before the logarithm,
// and blocks of tissue given by a function of place.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "formats/machine/machine.h"
#include "imaging_support.h"
#include "runtime/imaging/physical/fast/physical_fast.h"

namespace sonocase::runtime {

// label(p): of Phantom, at the voxel centre p. The labels alone: no boundary records, no echo
// offsets. The block spans -60 to 60, -30 to 30 and -12 to 120 mm.
template <class Label>
CaseBundle block_of(double voxel_mm, const Label& label) {
    sonocase::testing::PhantomOptions options;
    options.voxel_mm = voxel_mm;
    options.boundaries = options.structure = false;
    options.lower = {-60, -30, -12};
    options.upper = {60, 30, 120};
    CaseBundle b = Phantom(options).bundle();
    std::vector<std::uint8_t> labels(b.grid.voxel_count());
    std::size_t at = 0;
    for (int k = 0; k < b.grid.size.z; ++k) {
        for (int j = 0; j < b.grid.size.y; ++j) {
            for (int i = 0; i < b.grid.size.x; ++i)
                labels[at++] = static_cast<std::uint8_t>(
                    label(b.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k})));
        }
    }
    b.label_bricks = bricks_from_dense<std::uint8_t>(labels, b.grid.size);
    return b;
}

// One frame's beams, before the logarithm. bundle: outlives it.
struct BeamBench {
    const CaseBundle& bundle;
    Exercise exercise;
    ScanGeometry geometry;
    PhysicalScene scene;
    physical::Tables tables;
    PhysicalNoise noise;
    SerialWorkers workers;
    std::vector<float> gain;
    std::unique_ptr<PhysicalFast> renderer;
    PhysicalFrame frame;
    std::vector<std::uint8_t> pixels;

    BeamBench(const CaseBundle& b, const Exercise& e, const std::string& machine, int edge_px)
        : bundle(b), exercise(e) {
        geometry = make_scan_geometry(exercise.probe, 192, 512, edge_px, edge_px);
        scene = *make_physical_scene(bundle);
        tables = physical::make_tables(exercise.probe, *built_in_machine(machine), geometry);
        noise = make_physical_noise(scene.textures->normal_levels, 1, 192 + 128);
        gain.assign(512, 0.0f);
        renderer = std::make_unique<PhysicalFast>(
            scene, geometry, tables, noise, press::press_face(exercise.probe),
            RenderContext{workers, serial_jobs(), available_simd_targets().front()});
        frame.row_gain_db = gain;
        pixels.resize(static_cast<std::size_t>(edge_px) * edge_px);
    }
    void run() { renderer->render(frame, {}, false, false, pixels); }
    // Amplitude after TGC; row: a sample.
    double amplitude(int row, int line) const {
        return std::sqrt(static_cast<double>(renderer->power_row(row)[line]));
    }
    int row_of(double mm) const { return static_cast<int>(mm / geometry.step_mm); }
};

// Only the effects that a test turns on.
struct BlockBench : BeamBench {
    BlockBench(const CaseBundle& b, const Exercise& e) : BeamBench(b, e, "classic", 128) {
        frame.effects = switches_of<PhysicalEffects>(
            kPhysicalEffects, std::vector<bool>(kPhysicalEffects.size(), false));
        frame.effects.point_spread = true;
    }
    // Amplitude before TGC; row: a sample.
    double envelope(int row, int line) const {
        return amplitude(row, line) / tables.rows[static_cast<std::size_t>(row)].gain;
    }
    double mean_envelope(int row) const {
        double sum = 0;
        for (int l = 32; l < 160; ++l) sum += envelope(row, l);
        return sum / 128;
    }
};

// A linear probe of 40 mm and 60 mm depth at 3.5 MHz: beams are parallel, places easy to name.
inline Exercise block_exercise() {
    Exercise e = phantom_exercise();
    e.probe.shape = ProbeShape::linear;
    e.probe.width_mm = 40;
    e.probe.depth_mm = 60;
    e.probe.frequency_mhz = 3.5;
    e.probe.focus_mm = 30;
    return e;
}

}  // namespace sonocase::runtime
