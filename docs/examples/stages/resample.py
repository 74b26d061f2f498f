# SPDX-License-Identifier: Apache-2.0
"""resample: labels go through the fit into cubic voxels, without the steps of the voxels that they come from.

The mannequin is larger than the patient, and the body grows by as much.
"""
import numpy as np

from body import HALF_AXES_MM, fit, read_labels, stage, torso


def show(folder):
    labels, table = torso(folder)
    fit(folder, labels, table)
    stage(folder, "resample", labels, "--registration", folder / "fit.json", "--voxel-mm", 2, "-o", folder / "cooked.seg.nrrd")
    voxels = np.sum(read_labels(folder / "cooked.seg.nrrd") > 0)
    return "volume of the body, ml", 8e-3 * voxels, 4e-3 / 3 * np.pi * np.prod(HALF_AXES_MM + 5), 0.03
