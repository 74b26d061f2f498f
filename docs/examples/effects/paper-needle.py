# SPDX-License-Identifier: Apache-2.0
"""needle in model `paper`: a cylinder through a slab, which fades with the distance from its tip.

Without the effect nothing shows where it is.
"""
from torso import liver


def show(torso):
    view = liver(torso, model="paper")
    tip = view.pose @ (12, 0, 75, 1)
    along = view.pose[:3, :3] @ (0.8, 0, 0.6)
    on, off = view.pair("needle", needle=(tip[:3], along))
    steel = view.truth.needle > 0
    return on, off, "mean grey of the needle", on[steel].mean(), off[steel].mean()
