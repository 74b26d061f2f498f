# SPDX-License-Identifier: Apache-2.0
"""point_spread: each echo is drawn out along the beam and, more so, across it.

Without the effect grain is as small as a sample along the beam, and as wide as the distance of two scatterers across it.
"""
import numpy as np

from torso import liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("point_spread")
    rows, columns = np.nonzero(view.area_of("liver") & view.depth(60, 120))
    alike = [np.corrcoef(p[rows, columns], p[rows, columns + 1])[0, 1] for p in (on, off)]
    return on, off, "correlation with the next pixel across", *alike
