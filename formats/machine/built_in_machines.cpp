// SPDX-License-Identifier: Apache-2.0

#include "formats/machine/machine_toml.h"
#include "formats/text/nearest_name.h"

namespace sonocase {
namespace {

// A machine of the nineties: one look, logarithmic grey, point spread from the frequency alone.
Machine classic() {
    Machine m;
    m.name = "classic";
    m.title = "Classic scanner, single look, logarithmic grey";
    m.beam.axial_mm = m.beam.lateral_mm = 0;
    m.beam.lateral_focus_mm = 0;
    m.beam.skirt = 0;
    m.beam.aperture_mm = 0;
    m.beam.lines = 192;
    m.looks = {1, 1, 0};
    m.grey = {GreyMap::log, 0, 131.5, 1, 255, 1, 60};
    m.noise = {-70, false};
    m.gain = {0, 500, 0, 0};
    m.near_field = {1.6, 2.2, 0.3, 9, 0, 0.5, 1.9, 0, 0, 0.8, 1, 3};
    m.haze = {0, 4.5, 2, -24};
    m.contact = {0, 0};
    m.equalisation.amount = 0;
    m.speckle_reduction.variation = 0;
    m.structures = {false, false, false, false, false};
    m.post_filter = true;
    return m;
}

// Widths and depths of a small-parts probe; grain and depth profile of the usgra-seg images
// (Mindray TE7, L14-6Ns, CC BY 4.0), whose scale of 38 mm per face is an assumption.
Machine modern_linear() {
    Machine m;
    m.name = "modern-linear";
    m.title = "Modern scanner, linear probe";
    m.beam.reference_mhz = 9;
    m.beam.axial_mm = 0.23;
    m.beam.lateral_mm = 0.22;
    m.beam.lateral_focus_mm = 20;
    m.beam.lateral_range_mm = 25;
    m.beam.skirt = 1;
    m.beam.skirt_width = 5.2;
    m.beam.aperture_mm = 0;
    m.beam.lines = 192;
    m.looks = {4, 5, 8};
    m.grey.floor = 3;
    m.grey.level = 76;
    m.grey.exponent = 0.6;
    m.noise.grain_db = 1.3;
    m.gain = {0, 11, 3.5, 12};
    m.near_field = {1, 0.9, 0, 9, 3, 0.3, 0.8, 4, 2.2, 0.35, 0.5, 1.5};
    m.haze = {0.2, 1.6, 0.8, -120};
    m.contact = {6, 0.05};
    m.equalisation.amount = 0;
    m.speckle_reduction.variation = 0;
    return m;
}

}  // namespace

std::vector<std::string> machine_names() {
    return {"classic", "modern", "modern-linear"};
}

Result<Machine> built_in_machine(std::string_view name) {
    if (name == "classic") return classic();
    if (name == "modern") return Machine{};
    if (name == "modern-linear") return modern_linear();
    return Error{"no machine is called '" + std::string(name) + "'", "",
                 suggest_name(name, machine_names())};
}

}  // namespace sonocase
