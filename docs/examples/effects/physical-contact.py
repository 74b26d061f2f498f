# SPDX-License-Identifier: Apache-2.0
"""contact: a gap of a few millimetres between face and skin closes, as gel and a soft hand close it.

The probe hangs 8 mm above the flank. Without the effect it looks through air, from which nothing comes back here.
"""
from torso import liver


def show(torso):
    view = liver(torso, pressed_mm=-8)
    on, off = view.pair("contact")
    face = view.near((view.pose @ (0, 0, 6, 1))[:3], 4)
    return on, off, "mean grey below the middle of the face", on[face].mean(), off[face].mean()
