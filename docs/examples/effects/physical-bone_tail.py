# SPDX-License-Identifier: Apache-2.0
"""bone_tail: behind a bone's face the echo dies away within millimetres, down to a floor of side lobes.

Without the effect the rib's shadow is black from its face on.
"""
from torso import rib


def show(torso):
    view = rib(torso)
    on, off = view.pair("bone_tail")
    floor = (view.truth.shadowed > 0) & view.depth(30)
    return on, off, "mean grey of the shadow beyond 30 mm", on[floor].mean(), off[floor].mean()
