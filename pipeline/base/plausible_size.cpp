// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/plausible_size.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sonocase::pipeline {
namespace {

double largest(Vector3 extent) {
    return std::max({extent.x, extent.y, extent.z});
}

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", value);
    return text;
}

struct Unit {
    const char* name;
    double factor;  // mm
};
constexpr Unit kUnits[] = {{"metres", 1000},
                           {"decimetres", 100},
                           {"inches", 25.4},
                           {"centimetres", 10},
                           {"tenths of a millimetre", 0.1},
                           {"hundredths of a millimetre", 0.01},
                           {"micrometres", 0.001}};

// The unit in which the extent comes nearest to `target_mm`, by ratio.
const Unit* likely_unit(double extent, double target_mm) {
    const Unit* best = nullptr;
    double best_ratio = 4;  // a larger ratio is not due to a unit
    for (const Unit& unit : kUnits) {
        const double ratio = extent * unit.factor / target_mm;
        const double off = std::max(ratio, 1 / ratio);
        if (off < best_ratio) {
            best_ratio = off;
            best = &unit;
        }
    }
    return best;
}

std::string advice(const Unit* unit, const std::string& option) {
    if (unit == nullptr) return "write the file in millimetres";
    return std::string("these look like ") + unit->name + ": give " + option + " " +
           number(unit->factor);
}

}  // namespace

std::optional<Error> check_torso_extent(Vector3 extent_mm,
                                        const std::string& what,
                                        const std::string& where,
                                        const std::string& option) {
    const double size = largest(extent_mm);
    if (size >= kSmallestTorso_mm && size <= kLargestTorso_mm) return std::nullopt;
    return Error{what + " is " + number(extent_mm.x) + " x " + number(extent_mm.y) + " x " +
                     number(extent_mm.z) + " mm",
                 where,
                 "expected a torso of some 400 mm; " + advice(likely_unit(size, 400), option)};
}

std::optional<Error> check_same_unit(Vector3 body_extent_mm,
                                     Vector3 surface_extent_mm,
                                     const std::string& where) {
    const double body = largest(body_extent_mm), surface = largest(surface_extent_mm);
    const double ratio = surface / body;
    if (ratio > 1.0 / 6 && ratio < 6) return std::nullopt;
    return Error{"surface is " + number(surface) + " mm long and the body " + number(body) + " mm",
                 where,
                 "expected two torsos of like size; if the surface is wrong, " +
                     advice(likely_unit(surface, body), "inputs.surface_scale =")};
}

}  // namespace sonocase::pipeline
