// SPDX-License-Identifier: Apache-2.0

// The acoustic and mechanical properties of a tissue. One table serves both image models.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sonocase {

enum class TissueKind : std::uint8_t { outside, soft, fluid, gas, bone };

// How a tissue yields to a pressing probe and a needle.
struct TissueMechanics {
    double stiffness_kpa = 8;  // Young's modulus at small strain, 0.05 to 1e4
    bool drains = false;       // a lumen whose blood leaves when it is pressed: a vein
    double puncture_n = 0.1;   // force at which an 18 G needle enters it, 0 to 100
    bool rigid = false;        // bone, metal: neither pressed nor punctured
    friend bool operator==(const TissueMechanics&, const TissueMechanics&) = default;
};

inline constexpr double kMinStiffnessKpa = 0.05, kMaxStiffnessKpa = 1e4;
inline constexpr double kMaxPunctureN = 100;

struct Tissue {
    std::string name;  // e.g. "liver"
    TissueKind kind = TissueKind::soft;
    bool casts_shadow = false;  // model paper: counted along the ray

    std::string texture;   // name of a solid texture; empty: flat grey
    double grey_mean = 0;  // model paper, [0, 255]
    double grey_sd = 0;    // model paper, contrast of the texture about grey_mean

    double echo_db = 0;                // mean echogenicity re liver
    double structure_db = 0;           // standard deviation of the mid-scale echo offset
    double attenuation_db_cm_mhz = 0;  // one way
    double impedance_mrayl = 1.6;
    double sound_speed_m_s = 1540;

    std::string source;  // where the figures come from; "(assumed)" marks an assumption

    // As the recipe says; empty: see mechanics_of().
    std::optional<TissueMechanics> mechanics = {};
};

// Stiffness, drainage and puncture force of a label. A recipe's figures come first; then the
// built-in table, by the name of the tissue; then the kind of the tissue, so that older bundles
// without such figures can be pressed as well.
//
// Blood is a vein, an artery or a thrombus by the name of its label: veins drain and close under
// light pressure, arteries stay round, a thrombosed vein does not close. A vessel whose name says
// none of these counts as an artery, because a vessel that stays open cannot hide a thrombosis.
//
// Young's moduli in kPa at small strain, across the fibres; forces for an 18 G needle. Sources are
// beside the figures in tissue.cpp; "(assumed)" marks an assumption.
//
// Cost: some string comparisons; meant for when a scene is opened.
TissueMechanics mechanics_of(const Tissue& tissue, std::string_view label_name);

// The same without a recipe's figures.
TissueMechanics built_in_mechanics(const Tissue& tissue, std::string_view label_name);

enum class Vessel { unknown, vein, artery, thrombus };

// By whole words of the name, whatever their case: vein, vena, cava, venous, portal; artery, aorta,
// carotid, trunk; thrombus, thrombosed, thrombosis.
Vessel vessel_of_label(std::string_view label_name);

}  // namespace sonocase
