# SPDX-License-Identifier: Apache-2.0
"""equalisation: a beam that is darker or brighter than its neighbours goes half the way to them.

The kidney behind ribs. Without the effect upright bands remain below them.
"""
from torso import changed, kidney


def show(torso):
    view = kidney(torso)
    on, off = view.pair("equalisation")
    return on, off, "change beyond 40 mm and above 30 mm", *changed(on, off, view.depth(45), view.depth(0, 25))
