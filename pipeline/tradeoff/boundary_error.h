// SPDX-License-Identifier: Apache-2.0

// How far the surfaces of a cooked volume are from the true ones: one figure in mm that can be
// compared between anatomies.
//
// At random points the cooked class is compared with the analytic torso's. The share of wrong
// points, divided by the true interface area per volume, is the mean distance by which surfaces are
// displaced. Area per volume comes from Crofton's formula: twice the rate at which short random
// segments change class.
#pragma once

#include <cstdint>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/brick_volume.h"
#include "formats/volume/label_volume.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline tradeoff {

struct BoundaryError {
    double displaced_mm = 0;  // mean displacement of the surfaces
    double wrong_share = 0;   // of the points inside the body
    int lost_labels = 0;      // labels of the palette without a voxel
};

// cooked: volume and boundary records in the mannequin frame, palette as analytic_torso_labels()
// names it; truth: the map that made the mannequin. Points whose true preimage lies outside
// truth.ct_box do not count. within: a box in the mannequin frame that confines the points; null:
// all. Deterministic. Cost: about 1 us per point.
BoundaryError measure_boundary_error(const LabelVolume& cooked,
                                     const BrickVolume<std::uint32_t>& boundary,
                                     const Registration& truth,
                                     const AnalyticBody& body = {},
                                     int points = 200000,
                                     const Box3* within = nullptr);

// The same for a bundle cooked from an analytic torso.
BoundaryError measure_boundary_error(const CaseBundle& bundle, const AnalyticInput& torso);

// The palette index at a point of the mannequin frame, with surfaces placed by the boundary
// records; 0 outside the grid.
std::uint8_t label_at_point(const LabelVolume& volume,
                            const BrickVolume<std::uint32_t>& boundary,
                            Point3 point);

}  // namespace sonocase::pipeline::inline tradeoff
