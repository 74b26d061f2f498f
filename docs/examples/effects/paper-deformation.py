# SPDX-License-Identifier: Apache-2.0
"""deformation in model `paper`: tissue gives way to the probe, as in model `physical`.

The probe presses by 8 mm over the femoral vessels.
"""
from torso import changed, groin


def show(torso):
    view = groin(torso, exercise="femoral-access", model="paper", press_mm=8)
    on, off = view.pair("deformation")
    vessels = view.area_of("blood", "vein", "artery")
    return on, off, "change at the vessels and where nothing is scanned", *changed(on, off, vessels, ~view.scanned)
