# SPDX-License-Identifier: Apache-2.0
"""looks: a machine sees the same tissue from several directions and averages, so that grain is less harsh.

Right: the same machine with a single look.
"""
from torso import liver


def show(torso):
    view = liver(torso)
    one, several = view.draw(looks=1), view.draw()
    deep = view.area_of("liver") & view.depth(60, 90)
    return several, one, "standard deviation of the liver's grey, one look and several", one[deep].std(), several[deep].std()
