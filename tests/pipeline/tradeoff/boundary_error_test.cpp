// SPDX-License-Identifier: Apache-2.0

#include "pipeline/tradeoff/boundary_error.h"

#include <gtest/gtest.h>

namespace sonocase::pipeline {
namespace {

Registration identity() {
    Registration r;
    r.quadratic = QuadraticMap::from_rigid({}, {0, 0, 0}, 100);
    r.ct_box = analytic_torso_grid({2, 2, 2}).bounds();
    return r;
}

TEST(BoundaryError, SamplingAtAVoxelDisplacesSurfacesByAQuarterOfIt) {
    // A plane at a uniformly random offset, seen through voxels of edge h: the mean displacement of
    // the stepped surface is h / 4 along an axis, somewhat less for slanted faces.
    const LabelVolume volume = sample_analytic_torso(analytic_torso_grid({2, 2, 2}));
    const BoundaryError error = measure_boundary_error(volume, {}, identity());
    EXPECT_GT(error.displaced_mm, 0.3);
    EXPECT_LT(error.displaced_mm, 0.6);
    EXPECT_EQ(error.lost_labels, 0);
}

TEST(BoundaryError, AShiftOfTheWholeAnatomyIsMeasuredAsHalfItsLengthPerFace) {
    // Faces turned every way see |cos| of a shift: one half of it on average over the sphere.
    const LabelVolume volume = sample_analytic_torso(analytic_torso_grid({3, 3, 3}));
    LabelVolume shifted = volume;
    shifted.grid.origin_mm = shifted.grid.origin_mm + Vector3{4, 0, 0};
    const double still = measure_boundary_error(volume, {}, identity()).displaced_mm;
    const double moved = measure_boundary_error(shifted, {}, identity()).displaced_mm;
    EXPECT_GT(moved, 1.2);
    EXPECT_LT(moved, 2.6);
    EXPECT_GT(moved, 1.8 * still);
}

}  // namespace
}  // namespace sonocase::pipeline
