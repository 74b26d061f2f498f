// SPDX-License-Identifier: Apache-2.0

// Depth and focus for an organ, as a machine's presets set them, in the window and in a browser.
#pragma once

namespace sonocase::runtime::inline engine {

struct ImagePreset {
    const char *name, *tip;  // English keys of the catalogue
    double depth_mm, focus_mm;
};
inline constexpr ImagePreset kPresets[] = {
    {"Liver", "Depth 16 cm, focus 8 cm", 160, 80},
    {"Kidney", "Depth 12 cm, focus 6 cm", 120, 60},
    {"Vessel", "Depth 5 cm, focus 2 cm", 50, 20},
    {"Deep", "Depth 22 cm, focus 12 cm", 220, 120},
};

}  // namespace sonocase::runtime::inline engine
