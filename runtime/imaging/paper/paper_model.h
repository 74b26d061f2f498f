// SPDX-License-Identifier: Apache-2.0

// The effects of model `paper`: their switches, their table and their constants. A new effect is a
// switch and a row here, with its arithmetic in paper_reference.cpp and in paper_kernels.cpp.
#pragma once

#include <array>

#include "runtime/imaging/core/effect_table.h"

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
     [](const PaperMet& m) { return m.pressed ? "" : "nothing is pressed"; }, "the probe presses"},
    {"slice", Pass::beams, 5, 2, 5},
    {"texture", Pass::beams, 3, 1, 1, &PaperEffects::texture},
    {"needle", Pass::needle, 1, 0, 2, &PaperEffects::needle,
     [](const PaperMet& m) {
         return !m.needle_given ? "no needle" : m.needle ? "" : "needle outside the slab";
     },
     "the needle shows in the slab"},
    {"noise", Pass::beams, 1, 0, 1, &PaperEffects::noise},
    {"shadow", Pass::beams, 1, 0, 0, &PaperEffects::shadow,
     [](const PaperMet& m) { return m.shadow ? "" : "no bone or gas crossed"; },
     "bone or gas crossed"},
    {"attenuation", Pass::beams, 0.5, 0, 0, &PaperEffects::attenuation},
    {"blur", Pass::filter, 1, 0, 2, &PaperEffects::blur},
    {"scan_conversion", Pass::convert, 1, 1, 7},
}};

}  // namespace sonocase::runtime

namespace sonocase::runtime::paper {

// Constants of the 2007 image model: those that the paper prints, and those that it leaves open.

inline constexpr double kNoiseSigma = 15;  // grey; printed
// Length of bone or gas that dims to 1/e; the paper only says "the more, the darker".
inline constexpr double kShadowLengthMm = 4;
// Depth that dims to 1/e; the paper only says "a decreasing function".
inline constexpr double kAttenuationLengthMm = 250;

// Radial blur: copies turned by j * kBlurStepRad about the fan's centre, j = -4..4, blended with
// these weights (sum 1). A linear probe's copies are shifted by j * kBlurStepMm.
inline constexpr int kBlurReach = 4;
inline constexpr double kBlurStepRad = 0.0035;
inline constexpr double kBlurStepMm = 0.15;
inline constexpr std::array<double, 2 * kBlurReach + 1> kBlurWeights{0.04, 0.08, 0.12, 0.16, 0.20,
                                                                     0.16, 0.12, 0.08, 0.04};

}  // namespace sonocase::runtime::paper
