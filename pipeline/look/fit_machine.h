// SPDX-License-Identifier: Apache-2.0

// From measures to a machine: values are chosen so that a stand-in (stand_in.h), drawn on the same
// pixels and measured in the same way, has the scores of the real frames.
#pragma once

#include <string>
#include <vector>

#include "pipeline/look/measure_look.h"
#include "pipeline/look/stand_in.h"

namespace sonocase::pipeline::inline look {

struct FitOptions {
    Machine base;  // gives the values that cannot be measured, and the reference frequency
    Parenchyma tissue;
    std::uint64_t seed = 1;
};

// A number of looks with the grey map that fits it best.
struct LooksChoice {
    int looks = 1;
    GreyMap map = GreyMap::power;
    double exponent = 1;           // power
    double dynamic_range_db = 60;  // log
    double floor = 0;              // grey; the measured one, if black was seen
    double misfit = 0;             // 1: as much as scores differ between parts of one clip
};

struct FittedMachine {
    Machine machine;
    std::vector<LooksChoice> choices;  // best of each number of looks, by rising number
    std::vector<std::string> kept;     // fields that could not be measured: they are the base's
    std::vector<std::string> warnings;
};

// Grey level, exponent and looks are fitted together to mean, local sd over mean, skew and kurtosis
// of the even patches. Fewer looks with a smaller exponent give nearly the same picture; `choices`
// says how nearly. Without even patches, texture and grey map stay the base's, with a warning.
// Cost: 5 s.
FittedMachine fit_machine(const LookMeasures& measures,
                          const ScanPlace& place,
                          int width_px,
                          int height_px,
                          const FitOptions& options);

}  // namespace sonocase::pipeline::inline look
