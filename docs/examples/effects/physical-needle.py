# SPDX-License-Identifier: Apache-2.0
"""needle: a mirror of steel with the lobe and the tip of its make, its shadow, and a tail of lines below it.

In the plane, 53 degrees from the beam. Without the effect nothing shows where it is.
"""
import numpy as np

from torso import liver


def show(torso):
    view = liver(torso)
    tip = view.pose @ (12, 0, 75, 1)
    along = view.pose[:3, :3] @ (0.8, 0, 0.6)
    on, off = view.pair("needle", needle=(tip[:3], along))
    steel = view.truth.needle > 0
    return on, off, "90th percentile of the needle's grey", np.percentile(on[steel], 90), np.percentile(off[steel], 90)
