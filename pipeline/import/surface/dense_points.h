// SPDX-License-Identifier: Apache-2.0

// A cloud of a million readings, reduced to what a fit needs. Internal to import.
#pragma once

#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline {

inline constexpr std::size_t kDensePoints = 60000;  // a cloud of more is reduced

// The readings in each cube of 5 mm become one at their mean, in the order of the cubes; cubes that
// hold one to three readings where the others near them hold five times as many are readings in the
// air, which would count for as much as a cube full of skin. A cloud of kDensePoints or fewer is
// left alone.
// report  measures given_points and sparse_points (left out); may be null
// cloud  mm, finite
// Normals go. Cost: 0.2 us per reading.
void reduce_points(Surface& cloud, StageReport* report);

}  // namespace sonocase::pipeline
