// SPDX-License-Identifier: Apache-2.0

// The effects of model `physical`: their switches and their table. docs/effects.md says what each
// does, docs/extending.md how to add one.
#pragma once

#include "runtime/imaging/core/effect_table.h"

namespace sonocase::runtime {

struct PhysicalEffects {
    bool contact = true;      // gel gap closed, air gap dark
    bool deformation = true;  // tissue yields to the probe
    bool breathing = true;
    bool pulsation = true;
    bool elevation = true;       // beam thickness across the plane
    bool boundaries = true;      // sub-voxel planes between labels
    bool structure = true;       // echo offsets inside organs
    bool fine_structure = true;  // fibres and septa below the voxel
    bool parenchyma = true;      // uneven echo of organs
    bool targets = true;         // balls of the exercise
    bool streaks = true;         // plates in organs that face the beam
    bool diaphragm = true;       // between an organ and the lung
    bool wall = true;            // sheets between skin and organs
    bool speckle = true;
    bool interfaces = true;
    bool edge_shadow = true;
    bool attenuation = true;
    bool needle = true;
    bool bone_tail = true;
    bool gas_ring_down = true;
    bool point_spread = true;
    bool near_field = true;
    bool noise = true;
    bool persistence = true;
    bool clutter = true;            // reverberation below what is bright
    bool haze = true;               // side lobes
    bool equalisation = true;       // gain evened out across the beams
    bool speckle_reduction = true;  // smooth regions beside busy ones
    bool post_filter = true;
    bool edge_enhancement = true;
    bool grey_map = true;
};

// What a frame met.
struct PhysicalMet {
    bool pressed = false;       // the face lies below the resting skin
    bool gap = false;           // between the probe's face and the skin
    bool breathes = false;      // the anatomy is shifted
    bool pulses = false;        // arteries are wider or narrower than at rest
    bool interface = false;     // a surface between two labels
    bool has_echo = false;      // the bundle holds echo offsets
    bool fine = false;          // muscle or fat
    bool parenchyma = false;    // liver, spleen, kidney, glands
    bool target = false;        // near the slab
    bool streaks = false;       // plates that face the beam
    bool dome = false;          // an organ before the lung
    bool wall = false;          // between skin and organs
    bool refraction = false;    // a surface of fluid
    bool hard = false;          // bone or gas
    bool needle_given = false;  // there is a needle to draw
    bool needle = false;        // it shows in the slab
    int beams_in_contact = 0;
    // Which of these the machine has.
    bool edge_contact = false, compounding = false, receiver_noise = false, blending = false,
         reverberation = false, side_lobes = false, equalisation = false, speckle_reduction = false,
         binomial = false, sharpening = false, logarithm = false;
    // Structures that it shows.
    bool shows_parenchyma = false, shows_streaks = false, shows_diaphragm = false,
         shows_wall = false;
};

namespace physical {

inline const char* no_interface(const PhysicalMet& m) {
    return m.interface ? "" : "no interface crossed";
}
inline const char* nothing_hard(const PhysicalMet& m) {
    return m.hard ? "" : "no bone or gas crossed";
}

inline const char* only_if(bool machine_has_it) {
    return machine_has_it ? "" : "the machine has none";
}
// Why a structure is not shown: the machine shows none, or there is none in the frame.
inline const char* structure_if(bool machine_shows_it, bool met, const char* none) {
    return !machine_shows_it ? "the machine shows none" : met ? "" : none;
}

}  // namespace physical

inline constexpr std::array<EffectEntry<PhysicalEffects, PhysicalMet>, 35> kPhysicalEffects{{
    {"contact", Pass::contact, 1, 0, 0, &PhysicalEffects::contact,
     [](const PhysicalMet& m) {
         return m.gap || m.edge_contact ? "" : "the probe touches everywhere";
     },
     "a gap, or dark edges of the machine"},
    {"deformation", Pass::beams, 0.5, 2, 9, &PhysicalEffects::deformation,
     [](const PhysicalMet& m) { return m.pressed ? "" : "nothing is pressed"; },
     "the probe presses"},
    {"slice", Pass::beams, 4, 2, 7},
    {"breathing", Pass::beams, 1, 0, 8, &PhysicalEffects::breathing,
     [](const PhysicalMet& m) {
         return m.breathes ? "" : "the scenario does not breathe, or is at rest";
     },
     "the patient breathes"},
    {"pulsation", Pass::beams, 0.1, 0, 0, &PhysicalEffects::pulsation,
     [](const PhysicalMet& m) { return m.pulses ? "" : "no pulse"; }, "vessel walls move"},
    {"elevation", Pass::beams, 0.5, 0, 1, &PhysicalEffects::elevation},
    {"boundaries", Pass::beams, 3, 3, 12, &PhysicalEffects::boundaries, physical::no_interface,
     "surfaces crossed"},
    {"structure", Pass::beams, 1.5, 2, 5, &PhysicalEffects::structure,
     [](const PhysicalMet& m) { return m.has_echo ? "" : "the bundle holds no structure"; },
     "the bundle holds structure"},
    {"fine_structure", Pass::beams, 1, 1, 1, &PhysicalEffects::fine_structure,
     [](const PhysicalMet& m) { return m.fine ? "" : "no muscle or fat crossed"; },
     "muscle or fat crossed"},
    {"parenchyma", Pass::beams, 1, 1, 1, &PhysicalEffects::parenchyma,
     [](const PhysicalMet& m) {
         return physical::structure_if(m.shows_parenchyma, m.parenchyma, "no parenchyma crossed");
     },
     "parenchyma crossed"},
    {"targets", Pass::beams, 0.5, 1, 4, &PhysicalEffects::targets,
     [](const PhysicalMet& m) { return m.target ? "" : "no target near the slab"; },
     "a target near the slab"},
    {"streaks", Pass::beams, 0.3, 0, 0, &PhysicalEffects::streaks,
     [](const PhysicalMet& m) {
         return physical::structure_if(m.shows_streaks, m.streaks, "no plate faces the beams");
     },
     "plates face the beams"},
    {"diaphragm", Pass::beams, 0.1, 0, 0, &PhysicalEffects::diaphragm,
     [](const PhysicalMet& m) {
         return physical::structure_if(m.shows_diaphragm, m.dome, "no organ before a lung");
     },
     "an organ before a lung"},
    {"wall", Pass::beams, 0.3, 2, 0.5, &PhysicalEffects::wall,
     [](const PhysicalMet& m) {
         return physical::structure_if(m.shows_wall, m.wall, "no body wall near the face");
     },
     "body wall near the face"},
    {"speckle", Pass::beams, 2, 1, 2, &PhysicalEffects::speckle},
    {"interfaces", Pass::beams, 1, 1, 4, &PhysicalEffects::interfaces, physical::no_interface,
     "surfaces crossed"},
    {"edge_shadow", Pass::beams, 0.3, 0, 0, &PhysicalEffects::edge_shadow,
     [](const PhysicalMet& m) { return m.refraction ? "" : "no fluid crossed"; }, "fluid crossed"},
    {"attenuation", Pass::beams, 0.7, 2, 8, &PhysicalEffects::attenuation},
    {"bone_tail", Pass::beams, 0.2, 0, 4, &PhysicalEffects::bone_tail, physical::nothing_hard,
     "bone or gas crossed"},
    {"gas_ring_down", Pass::beams, 0.2, 0, 4, &PhysicalEffects::gas_ring_down,
     physical::nothing_hard, "bone or gas crossed"},
    {"clutter", Pass::beams, 0.4, 0, 4, &PhysicalEffects::clutter,
     [](const PhysicalMet& m) { return physical::only_if(m.reverberation); }, "the machine has it"},
    {"needle", Pass::needle, 1, 0, 12, &PhysicalEffects::needle,
     [](const PhysicalMet& m) {
         return !m.needle_given ? "no needle" : m.needle ? "" : "needle outside the slab";
     },
     "the needle shows in the slab"},
    {"point_spread", Pass::filter, 5, 0, 0, &PhysicalEffects::point_spread},
    {"looks", Pass::filter, 3, 0, 8, nullptr,
     [](const PhysicalMet& m) { return m.compounding ? "" : "the machine takes one look"; },
     "the machine averages several"},
    {"near_field", Pass::filter, 0.7, 0, 2, &PhysicalEffects::near_field},
    {"noise", Pass::filter, 0.7, 0, 2, &PhysicalEffects::noise,
     [](const PhysicalMet& m) { return m.receiver_noise ? "" : "the machine rejects it"; },
     "the machine has noise or grain"},
    {"persistence", Pass::filter, 0.7, 0, 6, &PhysicalEffects::persistence,
     [](const PhysicalMet& m) { return m.blending ? "" : "no noise to blend"; },
     "there is noise to blend"},
    {"haze", Pass::grey, 1, 0, 4, &PhysicalEffects::haze,
     [](const PhysicalMet& m) { return physical::only_if(m.side_lobes); }, "the machine has it"},
    {"equalisation", Pass::grey, 0.3, 0, 8, &PhysicalEffects::equalisation,
     [](const PhysicalMet& m) { return physical::only_if(m.equalisation); }, "the machine has it"},
    {"speckle_reduction", Pass::grey, 1, 0, 16, &PhysicalEffects::speckle_reduction,
     [](const PhysicalMet& m) { return physical::only_if(m.speckle_reduction); },
     "the machine has it"},
    {"compression", Pass::grey, 2, 0, 8},
    {"post_filter", Pass::grey, 1, 0, 0, &PhysicalEffects::post_filter,
     [](const PhysicalMet& m) { return physical::only_if(m.binomial); }, "the machine has it"},
    {"edge_enhancement", Pass::grey, 1, 0, 0, &PhysicalEffects::edge_enhancement,
     [](const PhysicalMet& m) { return physical::only_if(m.sharpening); }, "the machine has it"},
    {"grey_map", Pass::grey, 0.5, 0, 1, &PhysicalEffects::grey_map,
     [](const PhysicalMet& m) { return m.logarithm ? "" : "the machine has its own map"; },
     "the machine has no map of its own"},
    {"scan_conversion", Pass::convert, 1, 1, 7},
}};

}  // namespace sonocase::runtime
