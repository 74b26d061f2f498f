# SPDX-License-Identifier: Apache-2.0
"""structure: echoes that the pipeline bakes into the voxels: vessel trees, pyramids and sinus of the kidney, bowel wall.

Without the effect the kidney is even from its capsule to its hilum.
"""
from torso import changed, kidney


def show(torso):
    view = kidney(torso)
    on, off = view.pair("structure")
    return on, off, "change in the kidney and where nothing is scanned", *changed(on, off, view.area_of("kidney_right"), ~view.scanned)
