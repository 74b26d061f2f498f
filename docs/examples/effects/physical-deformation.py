# SPDX-License-Identifier: Apache-2.0
"""deformation: tissue gives way to the probe; a vein is pressed flat where an artery stays round.

The probe presses by 8 mm over the femoral vessels. Without the effect they lie as at rest, deeper by no more than the face.
"""
from torso import changed, groin


def show(torso):
    view = groin(torso, exercise="femoral-access", press_mm=8)
    on, off = view.pair("deformation")
    vessels = view.area_of("blood", "vein", "artery")
    return on, off, "change at the vessels and where nothing is scanned", *changed(on, off, vessels, ~view.scanned)
