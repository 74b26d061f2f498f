# SPDX-License-Identifier: Apache-2.0
"""wall: the long smooth sheets of the body wall: skin, fasciae, peritoneum, sheets of muscle.

Without the effect the wall above the liver is speckle with a texture.
"""
from torso import changed, liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("wall")
    return on, off, "change down to 30 mm and beyond 60 mm", *changed(on, off, view.depth(0, 30), view.depth(60))
