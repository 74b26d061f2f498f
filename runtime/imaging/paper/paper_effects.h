// SPDX-License-Identifier: Apache-2.0

// The effects of model `paper`: their switches and their table. A new effect is a switch and a row
// here, its arithmetic in paper_reference.cpp and in the kernels of paper_beams.cpp.
#pragma once

#include "runtime/imaging/formation/effect_table.h"

namespace sonocase::runtime {

struct PaperEffects {
    bool deformation = true, texture = true, needle = true, noise = true, shadow = true,
         attenuation = true, blur = true;
};

// What a frame met.
struct PaperMet {
    bool pressed = false;       // the face lies below the resting skin
    bool needle_given = false;  // there is a needle to draw
    bool needle = false;        // it shows in the slab
    bool shadow = false;        // something that casts a shadow was crossed
};

inline constexpr std::array<EffectEntry<PaperEffects, PaperMet>, 9> kPaperEffects{{
    {"deformation", Pass::beams, 1, 2, 9, &PaperEffects::deformation,
     [](const PaperMet& m) { return m.pressed ? "" : "nothing is pressed"; }},
    {"slice", Pass::beams, 5, 2, 5},
    {"texture", Pass::beams, 3, 1, 1, &PaperEffects::texture},
    {"needle", Pass::needle, 1, 0, 2, &PaperEffects::needle,
     [](const PaperMet& m) {
         return !m.needle_given ? "no needle" : m.needle ? "" : "needle outside the slab";
     }},
    {"noise", Pass::beams, 1, 0, 1, &PaperEffects::noise},
    {"shadow", Pass::beams, 1, 0, 0, &PaperEffects::shadow,
     [](const PaperMet& m) { return m.shadow ? "" : "no bone or gas crossed"; }},
    {"attenuation", Pass::beams, 0.5, 0, 0, &PaperEffects::attenuation},
    {"blur", Pass::filter, 1, 0, 2, &PaperEffects::blur},
    {"scan_conversion", Pass::convert, 1, 1, 7},
}};

}  // namespace sonocase::runtime
