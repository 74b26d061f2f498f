// SPDX-License-Identifier: Apache-2.0

// How a tissue looks and behaves under ultrasound. One table serves both image models.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sonocase {

enum class TissueKind : std::uint8_t { outside, soft, fluid, gas, bone };

// How a tissue yields to a pressing probe and a needle.
struct TissueMechanics {
    double stiffness_kpa = 8;  // Young's modulus at small strain, 0.05 to 1e4
    bool drains = false;       // a lumen whose blood leaves when it is pressed: a vein
    double puncture_n = 0.1;   // at which an 18 G needle enters it, 0 to 100
    bool rigid = false;        // bone, metal: neither pressed nor punctured
    friend bool operator==(const TissueMechanics&, const TissueMechanics&) = default;
};

inline constexpr double kLeastStiffnessKpa = 0.05, kGreatestStiffnessKpa = 1e4;
inline constexpr double kGreatestPunctureN = 100;

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

    std::string source;  // where the numbers come from; "(a)" marks an assumed one

    // As the recipe says; empty: by name and kind (formats/volume/tissue_mechanics.h).
    std::optional<TissueMechanics> mechanics = {};
};

}  // namespace sonocase
