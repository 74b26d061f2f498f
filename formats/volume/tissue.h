// SPDX-License-Identifier: Apache-2.0

// How a tissue looks and behaves under ultrasound. One table serves both image models.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sonocase {

enum class TissueKind : std::uint8_t { outside, soft, fluid, gas, bone };

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
};

}  // namespace sonocase
