# SPDX-License-Identifier: Apache-2.0
"""streaks: short bright plates, such as the walls of portal branches, that glint where they face the beam.

Without the effect the liver has no vessels but those of whole voxels.
"""
import numpy as np

from torso import liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("streaks")
    inside = view.area_of("liver")
    return on, off, "99th percentile of the liver's grey", *(np.percentile(p[inside], 99.5) for p in (on, off))
