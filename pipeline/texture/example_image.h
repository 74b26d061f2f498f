// SPDX-License-Identifier: Apache-2.0

// An example of the texture of a tissue: grey pixels of a B-mode image, and which of them to use.
// Preparation removes what is not tissue: the machine's depth trend and burnt-in graphics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace sonocase::pipeline::inline texture {

struct ExampleImage {
    std::string name;  // for messages: file or recipe
    int width = 0;     // pixels
    int height = 0;
    std::vector<float> grey;        // # width * height, [0, 255], row by row from the top
    std::vector<std::uint8_t> use;  // # width * height, 1: part of the example; empty: all of them

    std::size_t count() const { return static_cast<std::size_t>(width) * height; }
    std::size_t index(int x, int y) const { return x + static_cast<std::size_t>(width) * y; }
    bool used(std::size_t i) const { return use.empty() || use[i] != 0; }
};

// Returns the grey of the used pixels, in order.
std::vector<float> used_grey(const ExampleImage& image);

struct GreyMoments {
    std::size_t count = 0;  // used pixels
    double mean = 0;
    double squares = 0;  // sum of the squared deviations from the mean
    double sd() const;
};
GreyMoments grey_moments(const ExampleImage& image);

struct PreparedExample {
    ExampleImage image;  // without the trend, mean kept; burnt-in and non-finite pixels not used
    double mean = 0;     // grey of the used pixels
    double sd = 0;
    double trend_grey = 0;              // change of the mean from top to bottom that was removed
    double spread_ratio = 1;            // ratio of the sd, bottom to top, that was removed; 1: none
    double saturated = 0;               // share of used pixels at 0 or 255
    std::vector<std::string> warnings;  // whole sentences
};

// Removes the depth trend (only if few pixels are clipped and there are at least 8 grey levels): a
// line through the means of the rows, or a parabola if the example is at least 16 grains deep and
// the parabola explains more than chance would. If mean and spread increase together, the mean by
// half or more, the gain is assumed to multiply (a linear display) and the spread is equalised with
// it; under log compression gain is additive. Lateral changes stay: they belong to the tissue.
//
// Leaves out pixels that are not finite; flat rims; straight runs of one bright value (frames,
// rulers); strokes of one exact bright value that is a spike in the histogram (text).
//
// Error: fewer than 64 usable pixels, or no variation.
Result<PreparedExample> prepare_example(const ExampleImage& example);

}  // namespace sonocase::pipeline::inline texture
