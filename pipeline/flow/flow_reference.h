// SPDX-License-Identifier: Apache-2.0

// Normal flow: what leaves or enters the body's vessels, and how it pulses. docs/flow.md has the
// table with its sources.
#pragma once

#include <string_view>

#include "formats/flow/flow_field.h"

namespace sonocase::pipeline::inline flow {

enum class Outlet {
    leg,
    internal_iliac,
    renal,  // both
    coeliac,
    mesenteric,
    lumbar,
    splenic,
    unknown,  // by its size
};

struct OutletReference {
    const char* name;  // of the outlet, where the labels lack it
    double ml_s, sd_ml_s;
    FlowWave artery;   // its waveform
    double breathing;  // of the vein's flow: FlowVessel::breathing
};
const OutletReference& outlet_reference(Outlet outlet);

// The waveform of veins of a kind.
FlowWave vein_wave(FlowKind kind);
// "steady", "artery", "vein": for vessels whose names say nothing.
FlowWave named_wave(std::string_view name);

// What is known of a vessel by the name of its label.
struct VesselReference {
    double peak_mm_s = 0, sd_mm_s = 0;  // PSV; 0: not known
    double exponent = 3;                // of the mean profile
};
VesselReference vessel_reference(std::string_view label, FlowKind kind);

// The mean velocity that flow by size assumes (assumed), mm/s.
double usual_mean_mm_s(FlowKind kind);

// Returns the harmonics of a waveform given by values at phases, rising in [0, 1); periodic and
// monotone between them (Fritsch, Carlson 1980), scaled to mean 1.
struct WavePoint {
    double phase, value;
};
FlowWave wave_through(const WavePoint* points, int count);

}  // namespace sonocase::pipeline::inline flow
