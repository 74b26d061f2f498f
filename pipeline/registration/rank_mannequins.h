// SPDX-License-Identifier: Apache-2.0

// Which of several mannequins fits a patient best.
#pragma once

#include <string>
#include <vector>

#include "pipeline/registration/register_surfaces.h"

namespace sonocase::pipeline {

// How a fit compares with a good one: each figure over what is good, so that 1 or less is good.
struct Misfit {
    double skin = 0;      // 95th percentile of readings to skin over 2.7 mm
    double volume = 0;    // largest change of a solid organ or of all bones over 8 %
    double shape = 0;     // of the solid organ whose shape changes most over 0.2
    double coverage = 0;  // 0.6 over the share of readings with a counterpart
    bool proven = true;   // free of folds and one to one
    double worst() const;
};
Misfit misfit_of(const RegisterResult& result);

// Indices of the results, best first: proven maps before others, then by the worst figure.
std::vector<std::size_t> rank_results(const std::vector<RegisterResult>& results);

}  // namespace sonocase::pipeline
