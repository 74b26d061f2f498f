# SPDX-License-Identifier: Apache-2.0
"""speckle_reduction: what the scanner takes for even ground is smoothed, what it takes for structure keeps its detail.

Without the effect detail is as strong in one place as in another.
"""
from torso import changed, liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("speckle_reduction")
    return on, off, "change beyond 25 mm and above 12 mm", *changed(on, off, view.depth(25), view.depth(0, 12))
