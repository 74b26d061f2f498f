# SPDX-License-Identifier: Apache-2.0
"""texture: a patch of a real picture, grown into a solid block, colours each tissue by its place.

Without the effect a tissue has its mean grey.
"""
from torso import kidney


def show(torso):
    view = kidney(torso, model="paper")
    on, off = view.pair("texture")
    inside = view.area_of("liver", "kidney_right")
    return on, off, "standard deviation of grey in liver and kidney", on[inside].std(), off[inside].std()
