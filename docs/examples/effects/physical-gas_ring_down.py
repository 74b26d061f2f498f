# SPDX-License-Identifier: Apache-2.0
"""gas_ring_down: behind gas a dirty shadow that rings on, and lines at two and three times the depth of its face.

Bowel from the front. Without the effect the shadow of gas is as black as that of bone.
"""
from torso import FAN


def show(torso):
    view = torso.view("colon", (0, 0.3, 1), (0, 1, 0), FAN, aside_mm=(20, 0, 0))
    on, off = view.pair("gas_ring_down")
    shadow = view.truth.shadowed > 0
    return on, off, "mean grey of the shadow", on[shadow].mean(), off[shadow].mean()
