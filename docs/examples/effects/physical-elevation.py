# SPDX-License-Identifier: Apache-2.0
"""elevation: the beam is a slab, some millimetres thick away from its focus, and a pixel shows all of it.

Without the effect a picture is of a plane, so that the slanted face of an organ is as sharp as an upright one, and speckle
changes at once when the plane moves across itself.
"""
import numpy as np

import sonocase
from torso import liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("elevation")
    beside = sonocase.Pose.moved(view.pose, (0, 0.5, 0))
    moved = view.draw(pose=beside), view.draw("-elevation", pose=beside)
    inside = view.area_of("liver")
    alike = [np.corrcoef(a[inside], b[inside])[0, 1] for a, b in zip((on, off), moved)]
    return on, off, "correlation with the plane 0.5 mm beside it", *alike
