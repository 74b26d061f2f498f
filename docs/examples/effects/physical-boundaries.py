# SPDX-License-Identifier: Apache-2.0
"""boundaries: the surface between two labels is a plane inside a voxel, roughened, and not the voxel's face.

Without the effect the faces of rib and fascia are stairs of whole voxels, which nothing makes bright.
"""
import numpy as np

from torso import rib


def show(torso):
    view = rib(torso)
    on, off = view.pair("boundaries")
    bone = view.area_of("bone")
    return on, off, "99th percentile of the grey at the rib", np.percentile(on[bone], 99), np.percentile(off[bone], 99)
