// SPDX-License-Identifier: Apache-2.0

// Removes from an example what is not tissue: the machine's depth trend and burnt-in graphics.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

struct PreparedExample {
    ExampleImage image;  // without the trend, mean kept; burnt-in and non-finite pixels not used
    double mean = 0;     // grey of the used pixels
    double sd = 0;
    double trend_grey = 0;              // change of the mean from top to bottom that was removed
    double spread_ratio = 1;            // ratio of the sd, bottom to top, that was removed; 1: none
    double saturated = 0;               // share of used pixels at 0 or 255
    std::vector<std::string> warnings;  // whole sentences
};

// Depth trend (only if few pixels are clipped and there are at least 8 grey levels): a line through
// the means of the rows, or a parabola if the example is at least 16 grains deep and the parabola
// explains more than chance would. If mean and spread increase together, the mean by half or more,
// the gain is assumed to multiply (a linear display) and the spread is equalised with it; under log
// compression gain is additive. Only in depth: lateral changes belong to the tissue.
//
// Not used: pixels that are not finite; flat rims; straight runs of one bright value (frames,
// rulers); strokes of one exact bright value that is a spike in the histogram (text).
//
// Error: fewer than 64 usable pixels, or no variation.
Result<PreparedExample> prepare_example(const ExampleImage& example);

}  // namespace sonocase::pipeline
