// SPDX-License-Identifier: Apache-2.0

// Takes from an example what is not the tissue: the machine's depth trend, and what was burnt in.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/texture/example/example_image.h"

namespace sonocase::pipeline {

struct PreparedExample {
    ExampleImage image;  // trend taken off, mean kept; burnt-in and non-finite pixels not in use
    double mean = 0;     // grey of the used pixels
    double sd = 0;
    double trend_grey = 0;    // change of the mean from top to bottom that was taken off
    double spread_ratio = 1;  // sd at the bottom over sd at the top that was taken off; 1: none
    double saturated = 0;     // share of used pixels at 0 or 255
    std::vector<std::string> warnings;  // whole sentences
};

// Depth trend (not where the patch is clipped, or has a few levels only): a line through the row
// means; a parabola where the example is at least 16 grains deep and it explains more than chance
// would. Where mean and spread rise together by half or more, the gain is taken to multiply (a
// linear display) and the spread is evened out with it; log compression makes a gain additive. Only
// in depth: sideways changes belong to the tissue. Left out of use: pixels that are not finite,
// straight runs of one bright value (frames, rulers), and strokes of one exact bright value that
// the histogram shows as a spike (text). Error: fewer than 64 used pixels, or no variation at all.
Result<PreparedExample> prepare_example(const ExampleImage& example);

}  // namespace sonocase::pipeline
