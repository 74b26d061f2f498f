# SPDX-License-Identifier: Apache-2.0
"""smooth: surfaces lose the steps of the voxels, and each label keeps its volume.

A ball in voxels of 1 mm that has the steps of voxels of 2 mm: fewer of its voxels are wrong afterwards, and it is as large.
"""
import numpy as np

from body import points, read_labels, stage, write_labels


def show(folder):
    ball = sum(axis**2 for axis in points(48, 1)) < 16**2
    stepped = (sum(axis**2 for axis in points(24, 2)) < 16**2).repeat(2, 0).repeat(2, 1).repeat(2, 2)
    labels, _ = write_labels(folder, stepped, 1, [("ball", "liver")])
    stage(folder, "smooth", labels, "-o", folder / "smooth.seg.nrrd")
    smooth = read_labels(folder / "smooth.seg.nrrd") > 0
    assert np.sum(smooth != ball) < 0.8 * np.sum(stepped != ball)
    return "volume of the ball, ml", 1e-3 * smooth.sum(), 1e-3 * stepped.sum(), 0.001
