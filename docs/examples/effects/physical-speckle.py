# SPDX-License-Identifier: Apache-2.0
"""speckle: scatterers that stay with the tissue, whose echoes add up to grain.

Without the effect each tissue has its mean echo.
"""
import numpy as np

from torso import liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("speckle")
    inside = view.area_of("liver")[:, 1:]
    step = [np.abs(np.diff(p.astype(float), axis=1))[inside].mean() for p in (on, off)]
    return on, off, "step from pixel to pixel across the liver", *step
