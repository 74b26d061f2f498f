// SPDX-License-Identifier: Apache-2.0

// Small CSV tables for the calibrations: named points, and signals over time.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/calibration/lag.h"

namespace sonocase::pipeline::inline calibration {

struct NamedPoints {
    std::vector<std::string> names;  // # points, or empty
    std::vector<Point3> points;
};

// Reads rows name,x,y,z, or x,y,z without names, or columns by their names and markups of 3D Slicer
// (pipeline/base/point_table.h), in mm and RAS+. NaN is kept.
Result<NamedPoints> parse_named_points(std::string_view csv, const std::string& where);
Result<NamedPoints> load_named_points(const std::string& path);

// Returns the two in pairs: by name if both have names, else by order, which needs equal numbers.
Result<std::pair<NamedPoints, NamedPoints>> pair_points(const NamedPoints& known,
                                                        const NamedPoints& touched);

// Reads rows time_s,value.
Result<Signal> parse_signal(std::string_view csv, const std::string& where);
Result<Signal> load_signal(const std::string& path);

std::string digest_of_points(const std::vector<Point3>& points);

}  // namespace sonocase::pipeline::inline calibration
