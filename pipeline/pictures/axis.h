// SPDX-License-Identifier: Apache-2.0

// The axes of plots: ranges, places of values on the page, and round ticks whose labels do not
// overlap.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "pipeline/pictures/canvas.h"

namespace sonocase::pipeline::inline pictures {

struct Range {
    double low = INFINITY, high = -INFINITY;
    void include(double v);
};

// A margin on either side of the data; a range of its own if there are none.
void pad(Range& range, bool log_scale);

struct Axis {
    Range range;
    bool log = false;
    double from_px = 0, length_px = 1;
    double place(double v) const;  // in pixels
};

// Enlarges one of the ranges, so that one unit has the same length on both axes.
void equalise(Axis& x, Axis& y);

struct Tick {
    double value = 0;
    std::string label;  // empty: a fine line of the grid only
};

inline constexpr int kTickTextPx = 14;  // height of a tick's label
inline constexpr TextStyle kTickStyle{.colour = {25, 25, 25, 255}, .anchor = TextAnchor::middle};

// The densest ticks whose labels fit. The labels of an upright axis stand one above the other.
std::vector<Tick> fitting_ticks(const Axis& axis, bool upright);

// The smallest of 1, 2 and 5 times a power of ten that divides the span into at most max_steps.
double round_step(double span, int max_steps);
// Multiples of the step from low to high.
std::vector<double> multiples_between(double low, double high, double step);

}  // namespace sonocase::pipeline::inline pictures
