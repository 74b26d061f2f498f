// SPDX-License-Identifier: Apache-2.0

// Grids and registrations that the tests of segmentation share.
#pragma once

#include "pipeline/registration/map/registration.h"
#include "support/shapes.h"

namespace sonocase::testing {

// A registration that is a rigid motion, proven on the whole grid.
inline Registration rigid_registration(const Rigid& motion, const Grid& grid) {
    Registration registration;
    registration.mannequin_from_ct = motion;
    registration.quadratic = QuadraticMap::from_rigid(motion, {0, 0, 0}, 100);
    registration.ct_box = grid.bounds();
    registration.min_det_jacobian = 1;
    return registration;
}

// A centred cube of `edge` mm with pixels of 1 mm and slices along z.
inline Grid thick_grid(int edge, double slice_mm) {
    Grid grid = cubic_grid(edge);
    grid.spacing_mm.z = slice_mm;
    grid.size.z = static_cast<int>(edge / slice_mm);
    grid.origin_mm.z = -0.5 * slice_mm * (grid.size.z - 1);
    return grid;
}

}  // namespace sonocase::testing
